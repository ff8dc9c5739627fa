"""Read and write tables (CSV or Parquet by suffix) with errors that name the file, the line and the column."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.files import replace_path
from adaptive_flot.greybox.model import FloatArray

FIRST_LINE = 2
"""Line of a CSV file that holds row 0: messages count lines as an editor does."""


Source: TypeAlias = Path | str | pd.DataFrame
"""Where a table comes from: a file, or a table at hand."""


def named(source: Source) -> Path:
    """What messages call a table: its file, or `DataFrame` for a table at hand."""
    return Path("DataFrame") if isinstance(source, pd.DataFrame) else Path(source)


def read_table(source: Source) -> pd.DataFrame:
    """Read a table with a header line. Blank lines and empty last columns are dropped; the index keeps the row numbers.

    Rows of a table at hand are counted as lines of the CSV file that it would make.

    Raises
    ------
    DataError
        No such file, empty, not a table, rows longer than the header, or no rows.
    """
    file = named(source)
    if isinstance(source, pd.DataFrame):
        return _with_rows(source.reset_index(drop=source.index.name is None), file)
    if not file.is_file():
        raise DataError(f"{file}: no such file; give the path of a CSV or Parquet table")
    if file.stat().st_size == 0:
        raise DataError(f"{file}: the file is empty; give a table with a header line and rows")
    try:
        table = pd.read_parquet(file) if file.suffix == ".parquet" else _read_csv(file)
    except pd.errors.ParserWarning as error:
        raise DataError(f"{file}: a row is longer than the header (a decimal comma?); correct it") from error
    except (ValueError, OSError, pd.errors.ParserError) as error:
        raise DataError(f"{file}: not a readable table ({str(error).splitlines()[0]}); give CSV or Parquet") from error
    return _with_rows(table, file)


def _with_rows(table: pd.DataFrame, file: Path) -> pd.DataFrame:
    table = table.dropna(how="all")
    table = table.loc[:, [c for c in table.columns if not (str(c).startswith("Unnamed") and table[c].isna().all())]]
    if len(table.columns) == 0 or not str(table.columns[0]).isprintable():
        raise DataError(
            f"{file}: not a text table (no readable header); give a CSV or Parquet table with named columns"
        )
    if len(table) == 0:
        raise DataError(f"{file}: a header but no rows; give a table with rows")
    return table


def _read_csv(file: Path) -> pd.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # else pandas cuts rows longer than the header
        return pd.read_csv(file, skipinitialspace=True, index_col=False, skip_blank_lines=False)


def line(table: pd.DataFrame, row: int) -> int:
    """Line of the file that holds a row of the table."""
    return int(table.index[row]) + FIRST_LINE


def numeric_column(table: pd.DataFrame, column: str, file: Path | str) -> FloatArray:
    """Return one column as floats (N,), empty cells as NaN.

    Raises
    ------
    DataError
        The column holds text; the message names the line and the text.
    """
    raw = table[column]
    values = pd.to_numeric(raw, errors="coerce")
    bad = np.flatnonzero((values.isna() & raw.notna()).to_numpy())
    if bad.size:
        where = f"{file}: column {column!r}, line {line(table, int(bad[0]))}"
        raise DataError(f"{where}: {raw.iloc[bad[0]]!r} is not a number; correct it")
    return np.asarray(values, dtype=float)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write CSV (12 significant digits) or Parquet by suffix, whole or not at all."""
    with replace_path(path) as temporary:
        if path.suffix == ".parquet":
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.12g")
