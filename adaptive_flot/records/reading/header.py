"""Where header, units and data stand, and which columns hold the time."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.greybox.data.dataset import TIME_COLUMN
from adaptive_flot.records.reading.numbers import read_numbers
from adaptive_flot.records.reading.raw import RawTable, UnclearError
from adaptive_flot.records.reading.stamps import looks_like_time, looks_like_time_of_day
from adaptive_flot.records.tag_map import TimeKeys
from adaptive_flot.records.units import NORMAL, is_unit

LOOKED_AT = 200
"""Rows from which the layout is judged."""
TIME_WORDS = ("time", "timestamp", "datetime", "date", "zeit", "datum", "hora", "fecha", "heure", "t", "epoch", "clock")
_BRACKETS = re.compile(r"^(?P<name>.*?)[\s_]*(?:\[(?P<a>[^\[\]]*)\]|\((?P<b>[^()]*)\)|[,;]\s*(?P<c>\S+))$")


@dataclass(frozen=True)
class Layout:
    """Columns of a table and its first row of data.

    Attributes
    ----------
    names, units, descriptions
        Of each column; "" where there is none.
    first
        First row of data.
    time
        The column of the time, or those of date and time of day.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    descriptions: tuple[str, ...]
    first: int
    time: tuple[int, ...]


def split_unit(text: str) -> tuple[str, str]:
    """Name and unit of a header cell.

    >>> split_unit("Air flow [L/min]"), split_unit("FIC_101.PV")
    (('Air flow', 'L/min'), ('FIC_101.PV', ''))
    """
    found = _BRACKETS.match(text)
    inside = ((found["a"] or found["b"] or found["c"] or "") if found else "").strip()
    if not found or not found["name"] or not inside or not (is_unit(inside) or _meant_as_unit(inside)):
        return text, ""
    return found["name"].strip(), inside


def _meant_as_unit(text: str) -> bool:
    """Whether a text that is no unit was meant as one; it is then refused, and not passed over."""
    return " " not in text and ("/" in text or NORMAL.match(text) is not None)


def find_layout(raw: RawTable, keys: TimeKeys) -> Layout:
    """Find header, units, first row of data and columns of the time.

    Raises
    ------
    UnclearError
        Several columns of times.
    DataError
        No header, no column of times, or not the one that the map names.
    """
    head = raw.cells.head(LOOKED_AT)
    texts = [raw.texts(j).head(LOOKED_AT) for j in range(raw.cells.shape[1])]
    if raw.names:
        parts = [split_unit(name) for name in raw.names]
        names, units = tuple(p[0] for p in parts), tuple(p[1] for p in parts)
        time = _named(raw, names, keys) if keys.column else _time(raw, texts, names, 0)
        return Layout(names, units, ("",) * len(names), 0, time)
    if keys.column:
        row, time = _header_with(raw, texts, keys)
        first = _first_data(texts, time, row + 1, keys.format)
    else:
        first = _first_row(raw, texts)
        row = _header_above(raw, texts, first)
        time = ()
    if first >= len(head):
        raise DataError(f"{raw.file}: a header but no rows; give an export with values")
    names, units, descriptions = _columns(texts, row, first)
    _check_width(raw, names, first)
    if not time:
        time = _time(raw, texts, names, first)
    return Layout(names, units, descriptions, first, time)


def _check_width(raw: RawTable, names: tuple[str, ...], first: int) -> None:
    """Refuse rows with more cells than the header: nobody knows which value belongs to which tag."""
    for column in range(max(j for j, name in enumerate(names) if name) + 1, len(names)):
        beyond = raw.texts(column).iloc[first:]
        if (beyond != "").any():
            line = beyond.index[int(np.argmax((beyond != "").to_numpy()))]
            raise DataError(
                f"{raw.file}: line {line} has more cells than the header (a decimal comma, or a comma in a text?); "
                "correct it, or export with another separator"
            )


def _values(texts: pd.Series) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Mask of cells that are numbers or times, and no words."""
    number = np.isfinite(read_numbers(texts, ".")) | np.isfinite(read_numbers(texts, ","))
    found: np.ndarray[tuple[int], np.dtype[np.bool_]] = number | looks_like_time(texts).to_numpy()
    return found


def _first_row(raw: RawTable, texts: list[pd.Series]) -> int:
    """First row from which a column holds values, row after row, with as many cells as the table is wide."""
    masks = np.column_stack([_values(t) for t in texts])
    filled = np.column_stack([(t != "").to_numpy() for t in texts])
    used = [k for k in range(len(masks)) if filled[k].any()]
    wide = 0.5 * np.median(filled[used[len(used) // 2 :]].sum(axis=1))
    for place, k in enumerate(used):
        following = used[place : place + 2]
        if filled[k].sum() >= max(wide, 1) and masks[following].all(axis=0).any():
            return k
    raise DataError(f"{raw.file}: no rows with a time and values found; is this the right file?")


def _header_above(raw: RawTable, texts: list[pd.Series], first: int) -> int:
    """The row of the tags: of the rows just above the data the first that names most columns, and names no unit."""
    rows = []
    for k in range(first - 1, max(-1, first - 5), -1):
        cells = [t.iloc[k] for t in texts]
        if sum(c != "" for c in cells) < max(1.0, 0.6 * sum(t.iloc[first] != "" for t in texts)):
            break
        rows.append(k)
    tags = [k for k in rows if not _mostly_units([t.iloc[k] for t in texts])] or rows[-1:]
    if not tags:
        raise DataError(
            f"{raw.file}: no header above line {raw.cells.index[first]}; add a line with the names of the tags"
        )
    single = [k for k in tags if not any(" " in t.iloc[k] and not split_unit(t.iloc[k])[1] for t in texts[1:])]
    return min(single or tags)


def _mostly_units(cells: list[str]) -> bool:
    filled = [c.strip("[]() ") for c in cells if c]
    return len(filled) > 0 and sum(map(is_unit, filled)) >= max(1, len(filled) / 2)


def _columns(texts: list[pd.Series], row: int, first: int) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    parts = [split_unit(t.iloc[row]) for t in texts]
    units = [p[1] for p in parts]
    descriptions = [""] * len(texts)
    wide = 0.5 * sum(t.iloc[row] != "" for t in texts)
    for k in range(max(0, row - 1), first):
        cells = [t.iloc[k].strip("[]() ") for t in texts]
        if k == row or sum(c != "" for c in cells) < max(2.0, wide):
            continue
        if _mostly_units(cells) and k > row:
            units = [u or c for u, c in zip(units, cells, strict=True)]
        else:
            descriptions = [f"{d} {c}".strip() for d, c in zip(descriptions, cells, strict=True)]
    return tuple(p[0] for p in parts), tuple(units), tuple(descriptions)


def _header_with(raw: RawTable, texts: list[pd.Series], keys: TimeKeys) -> tuple[int, tuple[int, ...]]:
    wanted = (keys.column,) if isinstance(keys.column, str) else tuple(keys.column or ())
    for k in range(min(60, len(texts[0]))):
        cells = [t.iloc[k] for t in texts]
        places = [_place(cells, w) for w in wanted]
        if None not in places:
            return k, tuple(p for p in places if p is not None)
    first = _first_row(raw, texts)
    names = [t.iloc[_header_above(raw, texts, first)] for t in texts]
    raise DataError(f"{raw.file}: no column {wanted[0]!r} for the time; {near_match(wanted[0], filter(None, names))}")


def _place(cells: list[str], wanted: str) -> int | None:
    exact = [j for j, c in enumerate(cells) if c == wanted]
    return next(iter(exact or [j for j, c in enumerate(cells) if split_unit(c)[0] == wanted]), None)


def _named(raw: RawTable, names: tuple[str, ...], keys: TimeKeys) -> tuple[int, ...]:
    wanted = (keys.column,) if isinstance(keys.column, str) else tuple(keys.column or ())
    missing = [w for w in wanted if _place(list(names), w) is None]
    if missing:
        raise DataError(f"{raw.file}: no column {missing[0]!r} for the time; {near_match(missing[0], names)}")
    return tuple(j for j in (_place(list(names), w) for w in wanted) if j is not None)


def _first_data(texts: list[pd.Series], time: tuple[int, ...], start: int, form: str | None) -> int:
    column = texts[time[0]].iloc[start:]
    timed = _values(column) | looks_like_time_of_day(column).to_numpy()
    if form is not None and "%" in form:
        timed |= pd.to_datetime(column, format=form.split(" ")[0] if len(time) > 1 else form, errors="coerce").notna()
    return start + (int(np.argmax(timed)) if timed.any() else len(column))


def _time(raw: RawTable, texts: list[pd.Series], names: tuple[str, ...], first: int) -> tuple[int, ...]:
    """Columns of the time, by what they hold, then by their name."""
    data = [t.iloc[first:] for t in texts]
    typed = [j for j, c in enumerate(raw.cells) if pd.api.types.is_datetime64_any_dtype(raw.cells[c].dtype)]
    dates = typed or [j for j, t in enumerate(data) if _mostly(looks_like_time(t), t)]
    clocks = [j for j, t in enumerate(data) if j not in dates and _mostly(looks_like_time_of_day(t), t)]
    if len(dates) == 1:
        alone = not typed and not data[dates[0]].str.contains(":", regex=False).any()
        return (dates[0], clocks[0]) if alone and len(clocks) == 1 else (dates[0],)
    if len(dates) > 1:
        raise UnclearError(
            f"{raw.file}: {len(dates)} columns hold times", "time", [{"column": names[j]} for j in dates]
        )
    words = [re.split(r"[^a-z]+", name.lower()) for name in names]
    numbers = [j for j, w in enumerate(words) if w[0] in TIME_WORDS and _mostly(pd.Series(_values(data[j])), data[j])]
    own = [j for j in numbers if names[j] == TIME_COLUMN]
    if len(numbers) == 1 or own:
        return ((own or numbers)[0],)
    if numbers:
        raise UnclearError(
            f"{raw.file}: {len(numbers)} columns may hold times", "time", [{"column": names[j]} for j in numbers]
        )
    raise DataError(
        f"{raw.file}: no column of times found (columns: {', '.join(names[:8])}); name it in a map, as "
        "'time: {column: Timestamp}'"
    )


def _mostly(mask: pd.Series, texts: pd.Series) -> bool:
    filled = int((texts != "").sum())
    return filled > 0 and int(mask.sum()) >= 0.9 * filled - 1 and int(mask.sum()) > 0
