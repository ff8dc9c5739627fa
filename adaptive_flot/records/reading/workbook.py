"""Spreadsheets (xlsx), Parquet files and tables at hand."""

from __future__ import annotations

import datetime
import warnings
import zipfile
from pathlib import Path
from typing import Any

import pandas as pd

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.greybox.data.tables import MOST_ROWS, Source, named, read_table
from adaptive_flot.records.reading.raw import RawTable, UnclearError
from adaptive_flot.records.reading.text import read_text

BOOKS = (".xlsx", ".xlsm")
OTHER_BOOKS = (".xls", ".ods", ".xlsb", ".numbers")


def read_raw(source: Source, *, sheet: str | None = None, separator: str | None = None) -> RawTable:
    """Read an export into cells: a text file, a spreadsheet, Parquet, or a table at hand.

    Parameters
    ----------
    source
        File, or DataFrame.
    sheet
        Sheet of a spreadsheet; needed where several hold a table.
    separator
        Character between the cells of a text file; default it is found out.

    Raises
    ------
    UnclearError
        Several sheets.
    DataError
        No such file, unreadable, empty, or a form that is not known.
    """
    file = named(source)
    if isinstance(source, pd.DataFrame) or file.suffix.lower() == ".parquet":
        return _typed(read_table(source), file)
    if file.suffix.lower() in OTHER_BOOKS:
        raise DataError(f"{file}: a spreadsheet of a form that is not read; save it as .xlsx or CSV")
    if file.suffix.lower() in BOOKS:
        return _book(file, sheet)
    return read_text(file, separator)


def _typed(table: pd.DataFrame, file: Path) -> RawTable:
    cells = table.copy()
    names = tuple(str(c) for c in cells.columns)
    cells.columns = pd.RangeIndex(len(names))
    for column in cells.columns:
        kind = cells[column].dtype
        if not (pd.api.types.is_numeric_dtype(kind) or pd.api.types.is_datetime64_any_dtype(kind)):
            cells[column] = cells[column].map(_text)
    return RawTable(file, cells, point=True, names=names, found=("a table with typed columns",))


def _book(file: Path, sheet: str | None) -> RawTable:
    import openpyxl  # loaded where a spreadsheet is read, and nowhere else

    if not file.is_file():
        raise DataError(f"{file}: no such file; give the path of an export (CSV, Parquet or xlsx)")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that hold no values
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
            sheets = {s.title: list(s.iter_rows(values_only=True)) for s in book.worksheets}
            book.close()
    except (OSError, KeyError, ValueError, zipfile.BadZipFile, SyntaxError) as error:
        raise DataError(f"{file}: not a spreadsheet that can be read ({error}); save it again as .xlsx") from error
    filled = {title: rows for title, rows in sheets.items() if sum(any(v is not None for v in r) for r in rows) > 2}
    if sheet is not None and sheet not in sheets:
        raise DataError(f"{file}: no sheet {sheet!r}; {near_match(sheet, sheets)}")
    if sheet is None and len(filled) > 1:
        raise UnclearError(f"{file}: {len(filled)} sheets hold tables", "file", [{"sheet": title} for title in filled])
    if not filled:
        raise DataError(f"{file}: no sheet with a table; save the values, not formulas without results")
    rows = sheets[sheet] if sheet is not None else next(iter(filled.values()))
    if len(rows) > MOST_ROWS:
        raise DataError(f"{file}: more than {MOST_ROWS} rows; export a shorter span, or fewer tags")
    cells = pd.DataFrame([[_text(v) for v in row] for row in rows], dtype=str)
    cells.index = pd.RangeIndex(1, 1 + len(cells))
    return RawTable(file, cells, point=True, found=(f"a spreadsheet, sheet {sheet or next(iter(filled))!r}",))


def _text(value: Any) -> str:
    """Text of a typed cell: ISO times to the millisecond (a spreadsheet rounds to less), numbers in full."""
    if value is None or value is pd.NaT or (isinstance(value, float) and value != value):
        return ""
    if isinstance(value, datetime.datetime):
        rounded = value + datetime.timedelta(microseconds=500)
        return rounded.replace(microsecond=rounded.microsecond // 1000 * 1000).isoformat(sep=" ")
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    return str(value)
