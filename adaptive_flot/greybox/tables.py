"""Read and write tables (CSV or Parquet by suffix) with errors that name the file, the row and the column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.files import replace_path
from adaptive_flot.greybox.model import FloatArray

HEADER_LINES = 1
FIRST_LINE = HEADER_LINES + 1
"""Line of a CSV file that holds row 0: messages count lines as an editor does."""


def read_table(path: Path | str) -> pd.DataFrame:
    """Read a table with a header line; empty columns and empty last lines are dropped.

    Raises
    ------
    DataError
        No such file, empty, not a table, or no rows.
    """
    file = Path(path)
    if not file.is_file():
        raise DataError(f"{file}: no such file; give the path of a CSV or Parquet table")
    if file.stat().st_size == 0:
        raise DataError(f"{file}: the file is empty; give a table with a header line and rows")
    try:
        if file.suffix == ".parquet":
            table = pd.read_parquet(file)
        else:
            table = pd.read_csv(file, skipinitialspace=True, index_col=False)
    except (ValueError, OSError, pd.errors.ParserError) as error:
        raise DataError(f"{file}: not a readable table ({str(error).splitlines()[0]}); give CSV or Parquet") from error
    table = table.loc[:, [c for c in table.columns if not (str(c).startswith("Unnamed") and table[c].isna().all())]]
    if not str(table.columns[0]).isprintable():
        raise DataError(f"{file}: not a text table (unprintable header); give CSV or Parquet")
    if len(table) == 0:
        raise DataError(f"{file}: a header but no rows; give a table with rows")
    return table


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
        line = int(bad[0]) + FIRST_LINE
        raise DataError(f"{file}: column {column!r}, line {line}: {raw.iloc[bad[0]]!r} is not a number; correct it")
    return np.asarray(values, dtype=float)


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write CSV (12 significant digits) or Parquet by suffix, whole or not at all."""
    with replace_path(path) as temporary:
        if path.suffix == ".parquet":
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.12g")
