"""Numbers as plants write them: decimal comma, thousands, minus signs, and a unit behind the number."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import LARGEST
from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.records.reading.raw import RawTable, UnclearError

_NUMBER = r"[+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?"
_GROUPED = {",": r"[+-]?[1-9]\d{0,2}(?:,\d{3})+", ".": r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+"}
"""Digits in groups of three: whole thousands, or a number with three decimals where there is but one mark."""
_SPACES = re.compile("(?<=\\d)[   '’](?=\\d{3}(?!\\d))")
"""Spaces and apostrophes between thousands."""


def plain(texts: pd.Series) -> pd.Series:
    """Texts with ASCII signs and without spaces between thousands."""
    odd = texts.str.contains("[−   '’]", regex=True)
    if not odd.any():
        return texts
    return texts.where(~odd, texts.str.replace("−", "-").str.replace(_SPACES, "", regex=True))


def decimal_mark(raw: RawTable, columns: list[int], rows: slice) -> str:
    """Find the decimal mark, "." or ",", from all numbers of a file.

    Of two marks in a number the last is the decimal one; a mark that is there twice, or before three digits of a number
    that has no other, separates thousands. One mark before exactly three digits (`1,234`) says nothing by itself.

    Raises
    ------
    UnclearError
        Nothing but numbers as `1,234`.
    DataError
        Some numbers have a decimal point and others a decimal comma.
    """
    seen: dict[str, tuple[str, int]] = {}
    unclear: tuple[str, int] | None = None
    for column in columns:
        texts = plain(raw.texts(column).iloc[rows])
        texts = texts[texts.str.contains(r"[.,]", regex=True) & texts.str.fullmatch(_NUMBER)]
        for mark, other in ((",", "."), (".", ",")):
            own = texts[texts.str.contains(mark, regex=False)]
            if not len(own):
                continue
            both = own[own.str.contains(other, regex=False)]
            last = both[both.str.rfind(mark) > both.str.rfind(other)]
            alone = own[~own.str.contains(other, regex=False)]
            twice = alone[alone.str.count(re.escape(mark)) > 1]
            once = alone[alone.str.count(re.escape(mark)) == 1]
            grouped = once.str.fullmatch(_GROUPED[mark])
            for found, meant in ((last, mark), (once[~grouped], mark), (twice, other)):
                if len(found) and meant not in seen:
                    seen[meant] = str(found.iloc[0]), int(found.index[0])
            if mark == "," and grouped.any() and unclear is None:
                unclear = str(once[grouped].iloc[0]), int(once[grouped].index[0])
    if len(seen) == 2:
        (point, at), (comma, there) = seen["."], seen[","]
        raise DataError(
            f"{raw.file}: {point!r} in line {at} has a decimal point, {comma!r} in line {there} a decimal comma; "
            "export it with one of them"
        )
    if not seen and unclear is not None:
        raise UnclearError(
            f"{raw.file}: {unclear[0]!r} in line {unclear[1]} is a number with decimals, or with thousands",
            "file",
            [{"decimal": ","}, {"decimal": "."}],
        )
    return next(iter(seen), ".")


def read_numbers(texts: pd.Series, decimal: str) -> FloatArray:
    """Values (N,) of texts; NaN where a text is none, or too large to be measured."""
    if pd.api.types.is_numeric_dtype(texts.dtype):
        found = np.asarray(texts, dtype=float)
    else:
        other = "," if decimal == "." else "."
        cells = plain(texts)
        grouped = cells.str.contains(other, regex=False)
        if grouped.any():
            whole = rf"{_GROUPED[other]}(?:{re.escape(decimal)}\d*)?(?:[eE][+-]?\d+)?"
            right = cells.str.fullmatch(whole)
            cells = cells.where(~grouped, cells.where(right, "").str.replace(other, "", regex=False))
        if decimal == ",":
            cells = cells.str.replace(",", ".", regex=False)
        cells = cells.where(cells.str.fullmatch(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"), None)
        found = np.asarray(pd.to_numeric(cells, errors="coerce"), dtype=float)
    return np.where(np.abs(found) <= LARGEST, found, np.nan)


def unit_behind(texts: pd.Series) -> str:
    """Unit that stands behind most numbers of a column (`12.3 L/min`), or nothing."""
    filled = texts[texts != ""]
    parts = filled.iloc[:1000].str.extract(rf"^{_NUMBER}\s*([^\d\s.,+-].*)$")[0].dropna()
    if len(parts) < 0.5 * len(filled.iloc[:1000]) or parts.nunique() != 1:
        return ""
    return str(parts.iloc[0]).strip()


def without_unit(texts: pd.Series, unit: str) -> pd.Series:
    """Texts of a column without the unit behind the numbers."""
    return texts.str.removesuffix(unit).str.strip() if unit else texts
