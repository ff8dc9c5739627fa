"""Records in several stretches: rows between which inputs are not known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import numeric_column, time_column
from adaptive_flot.greybox.model import FloatArray

STRETCH = "stretch"
"""Column that numbers the stretches; a table without it is split where its time jumps."""
HOLE = 1.5
"""A step of the time that is longer than so many median ones is a hole."""
UNIFORMITY = 1e-3
"""Other steps differ by no more than this share of the median one."""
FEWEST_ROWS = 60
"""Rows of the shortest stretch between holes of the time that is worth a run."""


def longest_stretch(table: pd.DataFrame, time: str, file: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Rows of the longest stretch of a table, and what is left out, in words.

    No model is run across a gap: the state after it is not known.

    Parameters
    ----------
    table, time
        The table, and the name of its time column.
    file
        Where it comes from, for messages.

    Raises
    ------
    DataError
        The column of stretches holds no numbers.
    """
    number = _numbers(table, time, file)
    known, counts = np.unique(number, return_counts=True)
    if len(known) < 2:
        return table, ()
    best = int(np.argmax(counts))
    note = (
        f"the record has {len(known)} stretches with gaps between them: stretch {known[best]:g} is used, the longest, "
        f"with {counts[best]} of {counts.sum()} rows"
    )
    return table[number == known[best]], (note,)


def every_stretch(table: pd.DataFrame, time: str, file: Path) -> list[pd.DataFrame]:
    """All stretches of a table that are worth a run, in their order; the table itself where it is whole.

    Raises
    ------
    DataError
        The column of stretches holds no numbers.
    """
    number = _numbers(table, time, file)
    known, counts = np.unique(number, return_counts=True)
    if len(known) < 2:
        return [table]
    long_enough = known[counts >= min(FEWEST_ROWS, int(counts.max()))]
    return [table[number == k] for k in long_enough]


def _numbers(table: pd.DataFrame, time: str, file: Path) -> FloatArray:
    """Number of the stretch of each row (N,), from 1; all 1 where the times say nothing clear."""
    if STRETCH in table.columns:
        number = numeric_column(table, STRETCH, file)
        return np.where(np.isfinite(number), number, -1.0)
    whole = np.ones(len(table))
    if time not in table.columns or len(table) < FEWEST_ROWS:
        return whole
    try:
        steps = np.diff(time_column(table, time, file))
    except DataError:
        return whole  # the reader says what is wrong with the times
    usual = float(np.median(steps))
    holes = steps > HOLE * usual
    if not (usual > 0 and holes.any() and (np.abs(steps[~holes] - usual) <= UNIFORMITY * usual).all()):
        return whole
    number = 1.0 + np.concatenate([[0], np.cumsum(holes)])
    return number if np.unique(number, return_counts=True)[1].max() >= FEWEST_ROWS else whole
