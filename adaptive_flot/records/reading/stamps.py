"""Times of an export: their form, found out from all of them, and the clock times they stand for."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.records.reading.counted import UNITS, counted
from adaptive_flot.records.reading.numbers import plain, read_numbers
from adaptive_flot.records.reading.raw import RawTable, UnclearError
from adaptive_flot.records.reading.times import Stamps, check_all_read

_YMD = r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
_YEAR = r"(?P<y>\d{4}|\d{2})"
_AB = rf"(?P<a>\d{{1,2}})(?P<mark>[-/.])(?P<b>\d{{1,2}})[-/.]{_YEAR}"
_NAMED = r"(?P<d>\d{1,2})[-/. ](?P<month>[A-Za-z]{3})[a-z]*[-/., ]+(?P<y>\d{4}|\d{2})"
_CLOCK = (
    r"(?P<H>\d{1,2})[:.](?P<M>\d{2})(?:[:.](?P<S>\d{2})(?:[.,](?P<f>\d{1,9}))?)?(?:\s*(?P<p>[AaPp])\.?[Mm]\.?)?"
    r"\s*(?P<z>Z|UTC|GMT|[+-]\d{2}:?\d{2})?"
)
FORMS = {
    name: rf"(?:[A-Za-z]{{2,3}},?\s+)?{date}(?:[T ,]+{_CLOCK})?" for name, date in (("iso", _YMD), ("named", _NAMED))
} | {"numbers": rf"{_AB}(?:[T ,]+{_CLOCK})?"}
MONTHS = {m: k for k, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}
MOST_AFTER = 5
"""Lines without a time that may stand below a table, as `End of report`."""


def looks_like_time(texts: pd.Series) -> pd.Series:
    """Mask of texts that are a date, with or without a time of day."""
    mask = pd.Series(False, index=texts.index)
    for form in FORMS.values():
        mask |= texts.str.fullmatch(form).astype(bool)
    return mask


def looks_like_time_of_day(texts: pd.Series) -> pd.Series:
    """Mask of texts that are a time of day alone."""
    mask: pd.Series = texts.str.fullmatch(_CLOCK).astype(bool) & texts.str.contains(":", regex=False)
    return mask


def read_stamps(raw: RawTable, columns: tuple[int, ...], first: int, form: str | None, unit: str = "") -> Stamps:
    """Times of the rows from `first` on.

    Parameters
    ----------
    raw
        The table.
    columns
        The column of the time, or those of date and time of day.
    first
        First row of data.
    form
        Form, as a map names it; default it is found out.
    unit
        Unit in the header of a time that is a number.

    Raises
    ------
    UnclearError
        Two forms are equally good: day and month, or what a number counts.
    DataError
        A row without a time, or with one of another form.
    """
    kind = raw.cells[columns[0]].dtype
    if len(columns) == 1 and pd.api.types.is_datetime64_any_dtype(kind):
        return _typed(raw, columns[0], first)
    texts = raw.texts(columns[0]).iloc[first:]
    if len(columns) == 2:
        texts = (texts + " " + raw.texts(columns[1]).iloc[first:]).str.strip()
    rows = _rows(texts, form)
    texts = texts.iloc[rows]
    number = read_numbers(texts, "," if not raw.point and texts.str.contains(",").any() else ".")
    if form in UNITS or (form is None and np.isfinite(number).mean() > 0.9):
        return counted(raw, texts, number, form, unit, rows + first)
    if form is not None and "%" in form:
        dates = pd.to_datetime(texts, format=form, errors="coerce")
        check_all_read(raw, texts, dates.isna().to_numpy(), f"not of the form {form!r}")
        aware = dates.dt.tz is not None
        clock = (dates.dt.tz_convert("UTC").dt.tz_localize(None) if aware else dates).astype("datetime64[ns]")
        return Stamps(clock.to_numpy().astype(np.int64), aware, rows + first, form)
    return _written(raw, texts, form, rows + first)


def _typed(raw: RawTable, column: int, first: int) -> Stamps:
    dates = raw.cells[column].iloc[first:]
    rows = np.flatnonzero(dates.notna().to_numpy())
    dates = dates.iloc[rows]
    aware = dates.dt.tz is not None
    clock = (dates.dt.tz_convert("UTC").dt.tz_localize(None) if aware else dates).astype("datetime64[ns]")
    return Stamps(clock.to_numpy().astype(np.int64), aware, rows + first, "iso")


def _rows(texts: pd.Series, form: str | None) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Positions of the rows with a time; a few lines below the table may have none."""
    filled = np.flatnonzero((texts != "").to_numpy())
    last = texts.iloc[filled[-MOST_AFTER:]]
    if form is not None and ("%" in form or form in UNITS):
        timed = np.isfinite(read_numbers(last, ".")) if form in UNITS else np.ones(len(last), bool)
    else:
        timed = looks_like_time(last).to_numpy() | np.isfinite(read_numbers(last, "."))
        timed |= np.isfinite(read_numbers(last, ","))
    after = len(last) - 1 - int(np.flatnonzero(timed)[-1]) if timed.any() else 0
    return filled[: len(filled) - after]


def _written(raw: RawTable, texts: pd.Series, form: str | None, rows: Any) -> Stamps:
    """Times as dates and clock times."""
    texts = plain(texts)
    if texts.duplicated().mean() > 0.5:  # a row a value: the same times again and again
        codes, known = pd.factorize(texts)
        first = np.flatnonzero(~texts.duplicated().to_numpy())
        found = _written(raw, pd.Series(known, index=texts.index[first], dtype=texts.dtype), form, rows[first])
        return replace(found, clock=found.clock[codes], rows=rows)
    kinds = {name: texts.str.fullmatch(pattern).to_numpy(dtype=bool) for name, pattern in FORMS.items()}
    name = max(kinds, key=lambda k: int(kinds[k].sum()))
    check_all_read(raw, texts, ~kinds[name], "no time that is known")
    order = "iso"
    if name == "numbers":
        dates = texts.str.slice(0, 10).drop_duplicates().str.extract(rf"^{_AB[: -len(_YEAR)]}(?P<y>\d{{2,4}})")
        order = form if form in ("day-first", "month-first") else _order(raw, dates)
    quick = _quick(texts, name, order)
    if quick is not None:
        return Stamps(quick, False, rows, order)
    parts = texts.str.extract(FORMS[name])
    if name == "numbers":
        day, month = ("a", "b") if order == "day-first" else ("b", "a")
        parts = parts.assign(d=parts[day], m=parts[month])
    if name == "named":
        months = parts["month"].str.lower().map(MONTHS)
        check_all_read(raw, texts, months.isna().to_numpy(), "of a month that is not known")
        parts = parts.assign(m=months)
    clock, wrong = _instants(parts)
    check_all_read(raw, texts, wrong, "no time of any calendar" if form is None else f"no time, read {order}")
    zone = parts["z"]
    if zone.notna().any() and zone.isna().any():
        check_all_read(raw, texts, zone.isna().to_numpy(), "without an offset, where others have one")
    return Stamps(clock, bool(zone.notna().all()), rows, order)


def _quick(texts: pd.Series, name: str, order: str) -> Any:
    """Clock times of texts of the plainest forms, ten times as fast; None where a text is of another."""
    first = str(texts.iloc[0])
    if name == "iso":
        plainest = texts.str.fullmatch(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,9})?)?")
        if not plainest.all():
            return None
        dates = pd.to_datetime(texts, format="ISO8601", errors="coerce")
    else:
        found = re.fullmatch(r"\d{1,2}([-/.])\d{1,2}\1\d{4} \d{1,2}:\d{2}(:\d{2})?( [AP]M)?", first)
        if name != "numbers" or found is None:
            return None
        day, month = ("%d", "%m") if order == "day-first" else ("%m", "%d")
        clock = ("%I" if found[3] else "%H") + ":%M" + (":%S" if found[2] else "") + (" %p" if found[3] else "")
        dates = pd.to_datetime(texts, format=f"{day}{found[1]}{month}{found[1]}%Y {clock}", errors="coerce")
    if dates.isna().any():
        return None
    return dates.astype("datetime64[ns]").to_numpy().astype(np.int64)


def _order(raw: RawTable, parts: pd.DataFrame) -> str:
    """Whether day or month stands first; where no day is above 12, nobody knows."""
    a, b = parts["a"].astype(int), parts["b"].astype(int)
    day, month = int((a > 12).sum()), int((b > 12).sum())
    if day and month:
        line = parts.index[int(np.argmax((b > 12).to_numpy() if day >= month else (a > 12).to_numpy()))]
        raise DataError(f"{raw.file}: line {line}: day and month change places in the file; export it with one form")
    if day or month:
        return "day-first" if day else "month-first"
    if (parts["mark"] == ".").all():  # dates with dots are written in countries that put the day first
        return "day-first"
    row = parts.iloc[0]
    date = row["mark"].join((row["a"], row["b"], row["y"]))
    raise UnclearError(
        f"{raw.file}: line {parts.index[0]}: {date} has the day or the month first",
        "time",
        [{"format": "day-first"}, {"format": "month-first"}],
    )


def _instants(parts: pd.DataFrame) -> tuple[Any, Any]:
    """Clock times [ns since 1970], UTC where there is an offset, and a mask of those that do not exist."""

    def whole(key: str) -> Any:
        return pd.to_numeric(parts[key], errors="coerce").fillna(0).to_numpy(dtype=np.int64)

    year, hour = whole("y"), whole("H")
    year = np.where(year < 100, year + 2000, year)
    letter = parts["p"].str.lower()
    half = letter.notna().to_numpy()
    wrong = (hour > 23) | (whole("M") > 59) | (whole("S") > 59) | (half & ((hour < 1) | (hour > 12)))
    hour = np.where(half, hour % 12 + 12 * (letter == "p").to_numpy(), hour)
    date = pd.to_datetime(pd.DataFrame({"year": year, "month": whole("m"), "day": whole("d")}), errors="coerce")
    wrong |= date.isna().to_numpy()
    days = date.astype("datetime64[ns]").to_numpy().astype(np.int64)
    fraction = parts["f"].fillna("").str.ljust(9, "0").replace("", "0").astype(np.int64).to_numpy()
    clock = np.where(wrong, 0, days) + ((hour * 60 + whole("M")) * 60 + whole("S")) * 10**9 + fraction
    zone = parts["z"].fillna("")
    signed = zone.str.extract(r"^(?P<sign>[+-])(?P<h>\d{2}):?(?P<m>\d{2})$")
    minutes = 60 * signed["h"].fillna("0").astype(int) + signed["m"].fillna("0").astype(int)
    east = np.where(signed["sign"] == "-", -1, 1) * minutes.to_numpy()
    return clock - east * 60 * 10**9, wrong
