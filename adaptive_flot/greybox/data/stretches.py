"""Records in several stretches: rows between which inputs are not known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import STRETCH, UNIFORMITY, line, numeric_column, time_column
from adaptive_flot.greybox.data.lost_rows import MOST_TOLD
from adaptive_flot.greybox.data.repeated import repeated_rows
from adaptive_flot.greybox.model import FloatArray

HOLE = 1.5
"""A step of the time that is longer than so many median ones is a hole."""
FEWEST_ROWS = 60
"""Rows of the shortest stretch between holes of the time that is worth a run."""
FEWEST_AFTER_JUMP = 10
"""Rows after a jump back of the clock: fewer are stamps that are wrong, and no jump."""
MOST_REPEATED = 0.5
"""Share of the rows beyond which repetition is how the record is."""


LONGEST_IS_USED = "is used, the longest"
"""Words of the note on a record of which one stretch is used."""


def longest_stretch(table: pd.DataFrame, time: str, file: Path) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Rows of the longest stretch of a table, and what is left out, in words.

    No model is run across a gap, a jump of the clock or rows that were written twice: the state after it is not known.

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
    number, why = _numbers(table, time, file)
    known, counts = np.unique(number[np.isfinite(number)], return_counts=True)
    if len(known) < 2 and not why:
        return table, ()
    best = int(np.argmax(counts))
    used = (
        f"the record has {len(known)} stretches with gaps between them: stretch {known[best]:g} {LONGEST_IS_USED}, "
        f"with {counts[best]} of {len(table)} rows"
    )
    return table[number == known[best]], (*why, *([used] if len(known) > 1 else []))


def every_stretch(table: pd.DataFrame, time: str, file: Path) -> list[pd.DataFrame]:
    """All stretches of a table that are worth a run, in their order; the table itself where it is whole.

    Raises
    ------
    DataError
        The column of stretches holds no numbers.
    """
    number, why = _numbers(table, time, file)
    known, counts = np.unique(number[np.isfinite(number)], return_counts=True)
    if len(known) < 2 and not why:
        return [table]
    long_enough = known[counts >= min(FEWEST_ROWS, int(counts.max()))]
    return [table[number == k] for k in long_enough]


def _numbers(table: pd.DataFrame, time: str, file: Path) -> tuple[FloatArray, tuple[str, ...]]:
    """Number of the stretch of each row (N,), NaN for one that is left out; and what was found, in words."""
    number, why = _by_time(table, time, file)
    twice = repeated_rows(table, time)
    if not twice.any() or twice.mean() > MOST_REPEATED:
        return number, why
    begins = np.concatenate([[False], ~twice[1:] & twice[:-1]])
    pairs = np.column_stack([number, np.cumsum(begins)])
    renumbered = np.full(len(table), np.nan)
    renumbered[~twice] = 1.0 + np.unique(pairs[~twice], axis=0, return_inverse=True)[1].ravel()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], twice.astype(int), [0]])))
    spans = [f"{line(table, a)} to {line(table, b - 1)}" for a, b in zip(edges[::2], edges[1::2], strict=True)]
    more = f" and {len(spans) - MOST_TOLD} more" if len(spans) > MOST_TOLD else ""
    said = f"lines {', '.join(spans[:MOST_TOLD])}{more} repeat earlier rows: left out, and the record is split there"
    return renumbered, (*why, said)


def _by_time(table: pd.DataFrame, time: str, file: Path) -> tuple[FloatArray, tuple[str, ...]]:
    """Number of the stretch of each row (N,), from 1, by its column or by the times; all 1 where not clear."""
    if STRETCH in table.columns:
        number = numeric_column(table, STRETCH, file)
        return np.where(np.isfinite(number), number, -1.0), ()
    whole = np.ones(len(table))
    if time not in table.columns or len(table) < FEWEST_ROWS:
        return whole, ()
    try:
        steps = np.diff(time_column(table, time, file))
    except DataError:
        return whole, ()  # the reader says what is wrong with the times
    usual = float(np.median(steps))
    back = steps <= 0
    breaks = back | (steps > HOLE * usual)
    if not (usual > 0 and breaks.any() and (np.abs(steps[~breaks] - usual) <= UNIFORMITY * usual).all()):
        return whole, ()
    number = 1.0 + np.concatenate([[0], np.cumsum(breaks)])
    counts = np.unique(number, return_counts=True)[1]
    if counts.max() < FEWEST_ROWS or (back.any() and counts.min() < FEWEST_AFTER_JUMP):
        return whole, ()
    at = [line(table, int(k) + 1) for k in np.flatnonzero(back)]
    said = f"the clock jumps back in line {', '.join(map(str, at[:MOST_TOLD]))}: the record is split there"
    return number, (said,) if at else ()
