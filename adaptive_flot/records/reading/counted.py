"""Times that are numbers: seconds since 1970, days of a spreadsheet, or time since the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.records.reading.raw import RawTable, UnclearError
from adaptive_flot.records.reading.times import Stamps, check_all_read

UNITS = {"epoch s": 1e9, "epoch ms": 1e6, "seconds": 1e9, "minutes": 60e9, "hours": 3600e9, "excel": 86_400e9}
"""Nanoseconds in one, by form of a time that is a number."""
EXCEL_ZERO = np.datetime64("1899-12-30", "ns")


def counted(raw: RawTable, texts: pd.Series, number: Any, form: str | None, unit: str, rows: Any) -> Stamps:
    """Times (N,) from numbers (N,) of a form; None: found out from their size and the unit in the header.

    Raises
    ------
    UnclearError
        They may count several things.
    DataError
        One is no number, or too large for its form.
    """
    check_all_read(raw, texts, ~np.isfinite(number), "no number")
    found = form or _what_it_counts(raw, texts, number, unit)
    scaled = np.round(number * UNITS[found])
    if np.abs(scaled).max() > 9e18:
        raise DataError(f"{raw.file}: times up to {np.abs(number).max():g} are no {found}; give the form in a map")
    clock = scaled.astype(np.int64)
    if found == "excel":  # whole milliseconds: a day in a double is known to a microsecond
        return Stamps(np.round(clock, -6) + EXCEL_ZERO.astype(np.int64), False, rows, found)
    return Stamps(clock, True, rows, found, dated=found.startswith("epoch"))


def _what_it_counts(raw: RawTable, texts: pd.Series, number: Any, unit: str) -> str:
    named = {"s": "seconds", "sec": "seconds", "min": "minutes", "h": "hours", "hr": "hours"}.get(unit.lower())
    if named is not None:
        return named
    low, high = float(number.min()), float(number.max())
    if 1e9 <= low and high < 4e9:
        return "epoch s"
    if 1e12 <= low and high < 4e12:
        return "epoch ms"
    step = float(np.median(np.abs(np.diff(number)))) if len(number) > 1 else 1.0
    if 20_000 <= low and high < 80_000 and step < 1 / 24:  # the days from 1954 to 2119
        return "excel"
    choices = ("excel", "seconds") if 20_000 <= low and high < 80_000 else ("seconds", "minutes", "hours")
    raise UnclearError(
        f"{raw.file}: line {texts.index[0]}: the time {texts.iloc[0]} is a number that may count several things",
        "time",
        [{"format": choice} for choice in choices],
    )
