"""Rows that a logger has lost: put back without a measurement, where so few lie side by side that inputs are known."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import STRETCH, UNIFORMITY, line, time_column

IntArray = np.ndarray[Any, np.dtype[np.int64]]

MOST_LOST = 3
"""Rows side by side that are put back; a longer hole splits the record."""
MOST_SHARE = 0.1
"""Share of the rows beyond which lost ones are how the record is."""
MOST_TOLD = 3
"""Places that a note names."""


def with_lost_rows(
    table: pd.DataFrame, time: str, file: Path, outputs: Collection[str]
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """A table with the rows that its clock leaves out, and a note on them in words; as it is where none is, or many.

    Inputs of such a row are those of the row before it: over MOST_LOST sampling intervals nothing else is more likely.
    Its line for messages is that of the row before it, too.

    Parameters
    ----------
    table, time
        The table, and the name of its time column. One with a column of stretches is left as it is.
    file
        Where it comes from, for messages.
    outputs
        Columns that stay empty in such a row.
    """
    if STRETCH in table.columns or time not in table.columns or len(table) < 3:
        return table, ()
    try:
        times = time_column(table, time, file)
    except DataError:
        return table, ()  # the reader says what is wrong with the times
    steps = np.diff(times)
    usual = float(np.median(steps))
    if not (usual > 0 and (steps > 0).all()):  # not so with an empty time either
        return table, ()
    whole = np.round(steps / usual)
    lost = np.where((whole > 1) & (whole <= MOST_LOST + 1), whole - 1, 0).astype(int)
    filled = lost > 0
    even = np.abs(steps / np.maximum(whole, 1) - usual) <= UNIFORMITY * usual
    if not filled.any() or not even[filled].all() or lost.sum() > MOST_SHARE * len(table):
        return table, ()
    copies = np.append(1 + lost, 1)
    full = table.iloc[np.repeat(np.arange(len(table)), copies)].copy()
    place = np.concatenate([np.arange(n) for n in copies])  # 0 for a row of the table
    step = np.repeat(np.append(steps / (1 + lost), 0.0), copies)
    full[time] = np.where(place > 0, np.repeat(times, copies) + place * step, np.repeat(times, copies))
    empty = [c for c in full.columns if c in outputs]
    full[empty] = full[empty].mask(np.broadcast_to(place[:, None] > 0, (len(full), len(empty))))
    return full, (_said(table, lost),)


def _said(table: pd.DataFrame, lost: IntArray) -> str:
    at = np.flatnonzero(lost)
    lines = ", ".join(str(line(table, int(k))) for k in at[:MOST_TOLD])
    more = f" and {len(at) - MOST_TOLD} more" if len(at) > MOST_TOLD else ""
    count = int(lost.sum())
    rows = "1 row is" if count == 1 else f"{count} rows are"
    after = "line" if len(at) == 1 else "lines"
    return f"{rows} missing after {after} {lines}{more}: taken as rows without a measurement, with the inputs before"
