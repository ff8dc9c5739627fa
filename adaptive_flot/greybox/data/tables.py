"""Read and write tables (CSV or Parquet by suffix) with errors that name the file and what is wrong with it."""

from __future__ import annotations

import re
import unicodedata
import warnings
from pathlib import Path
from typing import TypeAlias

import pandas as pd
import pyarrow.parquet

from adaptive_flot.errors import DataError, OutputError
from adaptive_flot.files import replace_path
from adaptive_flot.greybox.data.columns import shown

MOST_ROWS = 2_000_000
"""Longest table: 23 days, one row a second."""
OTHER_SEPARATORS = {";": "a semicolon", "\t": "a tab", "|": "a bar"}
RAGGED = re.compile(r"Expected (?!1 )(\d+) fields in line (\d+), saw (\d+)")
"""What pandas says of a row that is longer than those before."""
SPREADSHEETS = (".xlsx", ".xlsm", ".xls", ".ods")

Source: TypeAlias = Path | str | pd.DataFrame
"""Where a table comes from: a file, or a table at hand."""


def named(source: Source) -> Path:
    """What messages call a table: its file, or `DataFrame` for a table at hand.

    Raises
    ------
    DataError
        It is neither.
    """
    if not isinstance(source, (pd.DataFrame, str, Path)):
        raise DataError(f"a record is a file or a table, and not {type(source).__name__}; give a path or a DataFrame")
    return Path("DataFrame") if isinstance(source, pd.DataFrame) else Path(source)


def read_table(source: Source) -> pd.DataFrame:
    """Read a table with a header line. Blank lines and empty last columns are dropped; the index keeps the row numbers.

    A file whose name ends in `.parquet` is Parquet; any other is CSV, packed where its name ends in `.gz`, `.bz2`,
    `.xz` or `.zip`. Rows of a table at hand are counted as lines of the CSV file that it would make.

    Raises
    ------
    DataError
        No such file, unreadable, empty, not a table, columns not separated by commas, rows longer than the header,
        a column twice, no rows or too many.
    """
    file = named(source)
    if isinstance(source, pd.DataFrame):
        return _with_rows(_plain(source, file), file)
    try:
        if not file.is_file():
            raise DataError(f"{file}: no such file; give the path of a CSV or Parquet table")
        if file.stat().st_size == 0:
            raise DataError(f"{file}: the file is empty; give a table with a header line and rows")
    except OSError as error:
        raise DataError(_unreadable(file, error)) from error
    if file.suffix.lower() in SPREADSHEETS:
        raise DataError(
            f"{file}: a spreadsheet; make a record of it with `adaptive-flot import`, or save its sheet as CSV"
        )
    return _with_rows(_read(file), file)


def _with_rows(table: pd.DataFrame, file: Path) -> pd.DataFrame:
    table = table.dropna(how="all")
    table = table.loc[:, [c for c in table.columns if not (c.startswith("Unnamed") and table[c].isna().all())]]
    if len(table.columns) == 0 or not table.columns[0].isprintable():
        raise DataError(
            f"{file}: not a text table (no readable header); give a CSV or Parquet table with named columns"
        )
    _check_header(table, file)
    if len(table) == 0:
        raise DataError(f"{file}: a header but no rows; give a table with rows")
    if len(table) > MOST_ROWS:
        raise DataError(_too_long(file))
    return table


def _read(file: Path) -> pd.DataFrame:
    try:
        return _read_parquet(file) if file.suffix.lower() == ".parquet" else _read_csv(file)
    except DataError:
        raise
    except pd.errors.ParserWarning as error:
        raise DataError(f"{file}: a row is longer than the header (a decimal comma?); correct it") from error
    except PermissionError as error:
        raise DataError(_unreadable(file, error)) from error
    except UnicodeDecodeError as error:
        why = "not a text in UTF-8: another encoding, or a spreadsheet under another name"
        raise DataError(f"{file}: {why}; give CSV or Parquet, or let `adaptive-flot import` read it") from error
    except Exception as error:  # damaged bytes: each of the unpackers and parsers has errors of its own
        said = next(iter(str(error).splitlines()), type(error).__name__)
        if ragged := RAGGED.search(said):
            expected, where, seen = ragged.groups()
            raise DataError(
                f"{file}: line {where} has {seen} values, where {expected} are expected; correct it"
            ) from error
        raise DataError(f"{file}: not a readable table ({said}); give CSV or Parquet") from error


def _read_csv(file: Path) -> pd.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # else pandas cuts rows longer than the header
        # pandas renames the second of two columns: what the file says is in its first line
        header = pd.read_csv(
            file, skipinitialspace=True, index_col=False, skip_blank_lines=False, nrows=1, header=None, dtype=str
        )
        _check_separator(header.iloc[0].dropna(), file)
        table = pd.read_csv(
            file, skipinitialspace=True, index_col=False, skip_blank_lines=False, nrows=MOST_ROWS + 1, low_memory=False
        )
    _check_repeated(header.iloc[0].dropna(), file)
    return table


def _read_parquet(file: Path) -> pd.DataFrame:
    if pyarrow.parquet.read_metadata(file).num_rows > MOST_ROWS:
        raise DataError(_too_long(file))
    return _plain(pd.read_parquet(file), file)


def _plain(table: pd.DataFrame, file: Path) -> pd.DataFrame:
    """A table whose index is a column as any other, where it has a name, and whose column names are texts."""
    plain = table.reset_index(drop=table.index.names == [None], allow_duplicates=True)
    plain.columns = pd.Index([str(c) for c in plain.columns], dtype=object)
    _check_repeated(plain.columns.to_series(), file)
    return plain


def _check_separator(names: pd.Series, file: Path) -> None:
    header = str(names.iloc[0]) if len(names) == 1 else ""
    found = [said for sign, said in OTHER_SEPARATORS.items() if sign in header]
    if found and header.replace("\t", "").isprintable():
        raise DataError(
            f"{file}: its columns are separated by {found[0]}, and not by a comma; make a record of it with "
            "'adaptive-flot import', which reads both"
        )


def _check_repeated(names: pd.Series, file: Path) -> None:
    repeated = names[names.duplicated()]
    if len(repeated):
        raise DataError(f"{file}: column {shown(repeated.iloc[0])} is there twice; rename or remove one of them")


def _check_header(table: pd.DataFrame, file: Path) -> None:
    for number, name in enumerate(table.columns[1:], start=2):
        if any(unicodedata.category(c) in ("Cc", "Cs") for c in name):
            raise DataError(f"{file}: the name of column {number}, {shown(name)}, can not be printed; rename it")


def _unreadable(file: Path, error: OSError) -> str:
    return f"{file}: can not be read ({error.strerror or error}); check the file and its permissions"


def _too_long(file: Path) -> str:
    return f"{file}: more than {MOST_ROWS} rows; cut the record or take every second row"


def check_table_path(path: Path) -> None:
    """Refuse a name that a table can not be written to.

    Raises
    ------
    OutputError
        The name ends neither in `.csv` nor in `.parquet`.
    """
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise OutputError(f"{path}: a table is written as .csv or .parquet; give such a name")


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write CSV (12 significant digits) or Parquet by suffix, whole or not at all.

    Raises
    ------
    OutputError
        Neither suffix, or the file can not be written there.
    """
    check_table_path(path)
    with replace_path(path) as temporary:
        if path.suffix.lower() == ".parquet":
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format="%.12g")
