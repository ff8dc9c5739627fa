"""Text files: encoding, separator, and cells."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import warnings
from collections import Counter
from pathlib import Path

import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.tables import MOST_ROWS
from adaptive_flot.records.reading.raw import RawTable

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""Byte order marks; that of UTF-16 begins that of UTF-32."""
SEPARATORS = (";", "\t", "|", ",")
_DECIMAL = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
LOOKED_AT = 200
"""Lines from which the separator is judged."""
MOST_BYTES = 2_000_000_000


def read_text(file: Path, separator: str | None = None) -> RawTable:
    """Read a text file (`.gz`: packed) into cells.

    Parameters
    ----------
    file
        The export.
    separator
        Character between cells; default what cuts the lines into the most cells, equally many a line.

    Raises
    ------
    DataError
        Unreadable, empty, no text, more than MOST_ROWS lines, or a line with more cells than all others.
    """
    text, encoding = _decoded(_bytes(file), file)
    lines = text.splitlines()[:LOOKED_AT]
    told = next((line[4:5] for line in lines[:1] if line.lower().startswith("sep=")), None)
    mark = separator or told or _separator(lines, file)
    start = 1 if told else 0
    width = max(len(row) for row in csv.reader(lines[start:], delimiter=mark))
    cells = _cells(text, mark, start, width, file)
    if len(cells) > MOST_ROWS:
        raise DataError(f"{file}: more than {MOST_ROWS} rows; export a shorter span, or fewer tags")
    cells.index = pd.RangeIndex(start + 1, start + 1 + len(cells))
    name = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar"}.get(mark, repr(mark))
    return RawTable(file, cells, found=(f"text in {encoding}, separated by {name}",))


def _bytes(file: Path) -> bytes:
    try:
        if not file.is_file():
            raise DataError(f"{file}: no such file; give the path of an export (CSV, Parquet or xlsx)")
        if file.stat().st_size > MOST_BYTES:
            raise DataError(f"{file}: larger than {MOST_BYTES} bytes; export a shorter span, or fewer tags")
        content = gzip.decompress(file.read_bytes()) if file.suffix.lower() == ".gz" else file.read_bytes()
    except (OSError, EOFError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError(f"{file}: can not be read ({reason}); check the file and its permissions") from error
    if not content.strip():
        raise DataError(f"{file}: the file is empty; export it again")
    return content


def _decoded(content: bytes, file: Path) -> tuple[str, str]:
    """Text and encoding: the byte order mark, else UTF-8, else UTF-16 by its zero bytes, else Windows-1252."""
    tried = [name for mark, name in MARKS if content.startswith(mark)][:1]
    if not tried:
        zeros = content[:1000].count(0) > len(content[:1000]) // 4
        tried = ["utf-16-le" if content[1:2] == b"\0" else "utf-16-be"] if zeros else ["utf-8", "cp1252"]
    for encoding in tried:
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text, encoding
    raise DataError(f"{file}: no text that can be read (tried {', '.join(tried)}); export it as CSV in UTF-8")


def _separator(lines: list[str], file: Path) -> str:
    """The separator with which most lines have the same, largest number of cells; a decimal comma is none."""
    best: tuple[float, str] = (0.0, "")
    filled = [line for line in lines if line.strip()]
    for mark in SEPARATORS:
        if mark == "," and best[1] and _commas_are_decimal(filled, best[1]):
            continue
        counts = Counter(len(row) for row in csv.reader(filled, delimiter=mark))
        width, times = max(counts.items(), key=lambda item: (item[1], item[0]))
        if width > 1:
            best = max(best, (times / counts.total() + 0.01 * min(width, 40), mark))
    if not best[1]:
        raise DataError(
            f"{file}: no separator found between cells (tried semicolon, tab, comma, bar); name it in a map, as "
            "'file: {separator: \"~\"}', or export it as CSV"
        )
    return best[1]


def _commas_are_decimal(lines: list[str], mark: str) -> bool:
    """Whether nearly all cells with a comma are numbers with one, once another separator has cut the lines."""
    with_comma = [cell.strip() for row in csv.reader(lines, delimiter=mark) for cell in row if "," in cell]
    return sum(_DECIMAL.fullmatch(cell) is not None for cell in with_comma) > 0.9 * len(with_comma)


def _cells(text: str, mark: str, start: int, width: int, file: Path) -> pd.DataFrame:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                io.StringIO(text),
                sep=mark,
                header=None,
                names=list(range(width)),
                index_col=False,
                dtype=str,
                na_filter=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                skiprows=start,
                nrows=MOST_ROWS + 1,
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        rows = csv.reader(io.StringIO(text), delimiter=mark)
        long = next((k for k, row in enumerate(rows, start=1) if len(row) > width), None)
        where = f"line {long} has more cells than the lines before" if long else " ".join(str(error).split())
        raise DataError(f"{file}: {where} (a decimal comma, or a comma in a name?); correct it") from error
