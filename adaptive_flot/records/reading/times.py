"""Times of the rows of an export, whatever their form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import shown
from adaptive_flot.records.reading.raw import RawTable

DAY = 86_400e9
FAR = 10.0
"""Spans of a record from the rest of it, at which a time is one of a clock that jumped."""


@dataclass(frozen=True)
class Stamps:
    """Times of the rows of an export.

    Attributes
    ----------
    clock
        Times (N,) [ns since 1970], as the clock of the file shows them.
    offset
        Whether these are UTC: the stamps have an offset of their own, or count from a fixed instant.
    rows
        Rows (N,) of the table that have a time; lines below the table are left out.
    form
        Their form, as a map names it.
    dated
        Whether they stand for dates at all; else they count from the start of the record.
    """

    clock: np.ndarray[Any, np.dtype[np.int64]]
    offset: bool
    rows: np.ndarray[Any, np.dtype[np.int64]]
    form: str
    dated: bool = True


def without_jumps(stamps: Stamps) -> tuple[Stamps, int]:
    """Leave out a few times far from all others, as a clock shows after a restart (1970); and how many they are.

    Far is ten times the span of the others, and a day at least. More than one in a hundred are no jumps.
    """
    low, high = np.quantile(stamps.clock.astype(float), (0.05, 0.95))
    reach = max(FAR * (high - low), DAY)
    near = (stamps.clock >= low - reach) & (stamps.clock <= high + reach)
    count = int((~near).sum())
    if not 0 < count <= max(1, len(near) // 100):
        return stamps, 0
    return replace(stamps, clock=stamps.clock[near], rows=stamps.rows[near]), count


def check_all_read(raw: RawTable, texts: pd.Series, wrong: np.ndarray[Any, np.dtype[np.bool_]], why: str) -> None:
    """Check that every time was read.

    Raises
    ------
    DataError
        Names the line of the first that was not, and what stands there.
    """
    if wrong.any():
        k = int(np.flatnonzero(wrong)[0])
        raise DataError(
            f"{raw.file}: line {texts.index[k]}: the time {shown(str(texts.iloc[k]))} is {why} ({int(wrong.sum())} in "
            "all); correct or remove the row, or give the form in a map, as 'time: {format: \"%d.%m.%Y %H:%M\"}'"
        )
