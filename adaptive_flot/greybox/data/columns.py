"""Columns of a table as numbers, times and dates, with errors that name the file, the line and the column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.model import FloatArray

FIRST_LINE = 2
"""Line of a CSV file that holds row 0: messages count lines as an editor does."""
TIME_COLUMN = "time_s"
"""The column of times."""
STRETCH = "stretch"
"""Column that numbers the stretches of a record; a table without it is split where its time jumps."""
UNIFORMITY = 1e-3
"""Largest difference between two sampling intervals, as a share of the usual one, that still counts as uniform."""
OR_IMPORT = ", or make a record of it with `adaptive-flot import`, which reads time stamps"
"""What to do where it holds dates."""
LARGEST = 1e30
"""Largest number that counts as measured; a logger writes 3.4e38 where it has none."""
LONGEST_SHOWN = 60
"""Characters of a wrong cell that a message repeats."""
NO_NUMBERS = {
    "boolean": "true and false",
    "bytes": "binary data",
    "complex": "complex numbers",
    "date": "dates",
    "datetime": "dates",
    "datetime64": "dates",
    "timedelta": "durations",
    "timedelta64": "durations",
    "time": "times of day",
    "period": "periods",
}
"""Kinds of columns that pandas would turn into numbers without a word, by its name for them."""


def shown(value: object) -> str:
    """A wrong value as a message repeats it."""
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."


def line(table: pd.DataFrame, row: int) -> int:
    """Line of the file that holds a row of the table."""
    return int(table.index[row]) + FIRST_LINE


def numeric_column(table: pd.DataFrame, column: str, file: Path | str) -> FloatArray:
    """Return one column as floats (N,), empty cells as NaN.

    Raises
    ------
    DataError
        The column holds text, an infinite or absurdly large number, or no numbers at all (true and false, dates,
        binary data). The message names the line and what stands there.
    """
    raw = table[column]
    if isinstance(raw.dtype, pd.CategoricalDtype):
        raw = raw.astype(raw.cat.categories.dtype)
    kind = NO_NUMBERS.get(pd.api.types.infer_dtype(raw, skipna=True))
    if kind is not None:
        raise DataError(f"{file}: column {column!r} holds {kind}; write numbers")
    values = pd.to_numeric(raw, errors="coerce")
    bad = np.flatnonzero((values.isna() & raw.notna()).to_numpy())
    if bad.size:
        where = f"{file}: column {column!r}, line {line(table, int(bad[0]))}"
        more = OR_IMPORT if column == TIME_COLUMN else ""
        raise DataError(f"{where}: {shown(raw.iloc[bad[0]])} is not a number; correct it{more}")
    found = np.asarray(values, dtype=float)
    large = np.flatnonzero(np.abs(found) > LARGEST)
    if large.size:
        where = f"{file}: column {column!r}, line {line(table, int(large[0]))}"
        raise DataError(
            f"{where}: {found[large[0]]:g} is no measured value ({large.size} in all); "
            "correct it, or leave the cell empty where nothing was measured"
        )
    return found


def time_column(table: pd.DataFrame, column: str, file: Path | str) -> FloatArray:
    """Return the times of the rows [s] (N,): numbers as they are, dates as seconds since the first, durations.

    Raises
    ------
    DataError
        Neither; see `numeric_column`.
    """
    raw = table[column]
    if pd.api.types.is_datetime64_any_dtype(raw.dtype):
        raw = raw - raw.min()
    if pd.api.types.is_timedelta64_dtype(raw.dtype):
        return np.asarray(raw.dt.total_seconds(), dtype=float)
    return numeric_column(table, column, file)


def date_column(table: pd.DataFrame, column: str, file: Path | str, form: str | None = None) -> pd.Series:
    """Return the dates of the rows (N,), texts or dates, as local times; `form` as for `strftime`, default ISO 8601.

    Raises
    ------
    DataError
        A cell that is no date, or a text with a time zone; the message names the line and the text.
    """
    raw = table[column]
    if pd.api.types.is_datetime64_any_dtype(raw.dtype):
        raw = raw.dt.strftime(form or "%Y-%m-%d %H:%M:%S.%f")
    raw = raw.astype(str)
    dates = pd.to_datetime(raw, format=form or "ISO8601", errors="coerce", utc=form is None)
    zoned = raw.str.contains(r"(?:Z|[+-]\d\d:?\d\d)$", regex=True) & raw.str.contains(":")
    for wrong, text in ((dates.isna(), "is no date"), (zoned, "has a time zone; leave it out")):
        if wrong.any():
            k = int(np.flatnonzero(wrong)[0])
            where = f"{file}: column {column!r}, line {line(table, k)}"
            raise DataError(f"{where}: {shown(raw.iloc[k])} {text}; write {form or 'year-month-day hour:minute'}")
    return dates.dt.tz_localize(None) if form is None else dates
