"""Columns (wide form) or rows (long form) of an export as signals."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.records.reading.clock import check_clock, to_utc
from adaptive_flot.records.reading.export import Export, Instants, Signal
from adaptive_flot.records.reading.header import Layout, find_layout, split_unit
from adaptive_flot.records.reading.numbers import decimal_mark, read_numbers, unit_behind, without_unit
from adaptive_flot.records.reading.raw import RawTable
from adaptive_flot.records.reading.stamps import read_stamps
from adaptive_flot.records.reading.times import Stamps, without_jumps
from adaptive_flot.records.reading.workbook import read_raw
from adaptive_flot.records.tag_map import FileKeys, TagMap, TimeKeys
from adaptive_flot.records.units import is_unit

LONG = {
    "tag": ("tag", "tagname", "point", "pointname", "name", "variable", "item", "signal", "messstelle"),
    "value": ("value", "val", "wert", "reading", "valor"),
    "quality": ("quality", "status", "confidence", "qualitaet", "calidad"),
    "unit": ("unit", "units", "uom", "eu", "einheit", "engunits"),
}
"""Names of the columns of the long form."""
GOOD = ("good", "ok", "192", "0xc0", "1", "100", "true", "valid", "g")
"""Qualities of a good value; case does not count."""


def read_export(source: Source, tag_map: TagMap) -> Export:
    """Read an export; what the map leaves open is found out.

    Raises
    ------
    UnclearError
        Several readings are equally good.
    DataError
        The file can not be read, or does not hold what the map says.
    """
    keys = tag_map.file
    raw = read_raw(source, sheet=keys.sheet, separator=keys.separator)
    layout = find_layout(raw, tag_map.time)
    time_unit = layout.units[layout.time[0]] or ("s" if layout.names[layout.time[0]].lower().endswith("_s") else "")
    stamps = read_stamps(raw, layout.time, layout.first, tag_map.time.format, time_unit)
    stamps, jumped = without_jumps(stamps)
    long = _long_columns(layout, keys, raw.file)
    values = [j for j in range(len(layout.names)) if j not in layout.time]
    numbers = [long["value"]] if long else values
    decimal = keys.decimal or ("." if raw.point else decimal_mark(raw, numbers, slice(layout.first, None)))
    parts = list(_long(raw, layout, stamps, long) if long else _wide(raw, layout, stamps, values))
    zone, said = _zone(stamps, tag_map.time, parts[: None if long else 1], raw.file)
    good = {q.lower() for q in (keys.good or GOOD)}
    signals = {}
    for part in parts:
        signal = _signal(part, decimal, good, zone, raw.file)
        if len(signal):
            signals[signal.tag] = signal
    if not signals:
        raise DataError(f"{raw.file}: no column of values beside the time; give an export with tags")
    names = [layout.names[j] for j in layout.time]
    column = names[0] if len(names) == 1 else (names[0], names[1])
    form = None if stamps.form == "iso" else stamps.form
    shape = "long form, a row a value" if long else "wide form, a column a tag"
    known = FileKeys(
        sheet=keys.sheet,
        separator=keys.separator,
        decimal=None if raw.point or decimal == "." else ",",
        form=keys.form or ("long" if long else None),
        **{k: layout.names[j] for k, j in long.items() if k in ("tag", "value", "quality")},
        good=keys.good,
    )
    odd = [f"left out: {jumped} rows with a time far from all others"] if jumped else []
    if any((np.diff(s.lines) < 0).any() for s in signals.values()):
        odd.append("rows that were not in the order of time: sorted")
    found = (
        *raw.found,
        shape,
        *odd,
        *(["decimal comma"] if decimal == "," else []),
        f"time: {' and '.join(names)}, {said}",
    )
    return Export(raw.file, signals, known, TimeKeys(column=column, zone=zone, format=form), found)


class _Part:
    """What becomes one signal: cells, qualities and clock times of its rows."""

    def __init__(self, tag: str, unit: str, description: str, texts: Any, quality: Any, stamps: Stamps, lines: Any):
        self.tag, self.unit, self.description = tag, unit, description
        self.texts, self.quality, self.stamps, self.lines = texts, quality, stamps, lines


def _long_columns(layout: Layout, keys: FileKeys, file: Path) -> dict[str, int]:
    """Columns of the long form by what they hold; none for a wide table."""
    if keys.form == "wide":
        return {}
    plain = [re.sub(r"[^a-z]", "", name.lower()) for name in layout.names]
    found = {}
    for what, words in LONG.items():
        given = getattr(keys, what, None)
        if given is not None:
            if given not in layout.names:
                raise DataError(
                    f"{file}: no column {given!r} (file: {{{what}: ...}}); {near_match(given, layout.names)}"
                )
            found[what] = layout.names.index(given)
        else:
            places = [j for j, name in enumerate(plain) if name in words and j not in layout.time]
            found |= {what: places[0]} if places else {}
    if "tag" in found and "value" in found:
        return found
    if keys.form == "long":
        missing = "tag" if "tag" not in found else "value"
        raise DataError(f"{file}: no column for the {missing}; name it in the map, as 'file: {{{missing}: NAME}}'")
    return {}


def _wide(raw: RawTable, layout: Layout, stamps: Stamps, columns: list[int]) -> Iterator[_Part]:
    lines = raw.cells.index.to_numpy()[stamps.rows]
    qualities = {j: k for k in columns for j in columns if k != j and _is_quality_of(layout.names[k], layout.names[j])}
    for j in columns:
        if not layout.names[j] or j in qualities.values():
            continue
        if layout.names.count(layout.names[j]) > 1:
            raise DataError(f"{raw.file}: the tag {layout.names[j]!r} is there twice; rename or remove one of them")
        cells = raw.cells[j] if pd.api.types.is_numeric_dtype(raw.cells[j].dtype) else raw.texts(j)
        quality = raw.texts(qualities[j]).iloc[stamps.rows] if j in qualities else None
        yield _Part(
            layout.names[j], layout.units[j], layout.descriptions[j], cells.iloc[stamps.rows], quality, stamps, lines
        )


def _is_quality_of(name: str, tag: str) -> bool:
    rest = name.removeprefix(tag) if name.startswith(tag) else ""
    return bool(rest) and re.sub(r"[^a-z]", "", rest.lower()) in LONG["quality"]


def _long(raw: RawTable, layout: Layout, stamps: Stamps, columns: dict[str, int]) -> Iterator[_Part]:
    lines = raw.cells.index.to_numpy()[stamps.rows]
    tags = raw.texts(columns["tag"]).iloc[stamps.rows]
    cells = raw.cells[columns["value"]].iloc[stamps.rows]
    texts = cells if pd.api.types.is_numeric_dtype(cells.dtype) else raw.texts(columns["value"]).iloc[stamps.rows]
    quality = raw.texts(columns["quality"]).iloc[stamps.rows] if "quality" in columns else None
    units = raw.texts(columns["unit"]).iloc[stamps.rows] if "unit" in columns else None
    for tag, rows in tags.groupby(tags, sort=False).indices.items():
        name, unit = split_unit(str(tag))
        if units is not None:
            own = {u for u in units.iloc[rows] if u}
            if len(own) > 1:
                raise DataError(f"{raw.file}: tag {tag!r} has the units {', '.join(sorted(own))}; export it with one")
            unit = unit or next((u for u in own if is_unit(u)), "")
        own_stamps = replace(stamps, clock=stamps.clock[rows], rows=stamps.rows[rows])
        yield _Part(
            name, unit, "", texts.iloc[rows], None if quality is None else quality.iloc[rows], own_stamps, lines[rows]
        )


def _zone(stamps: Stamps, keys: TimeKeys, parts: list[_Part], file: Path) -> tuple[str | None, str]:
    """Zone in which the clock times are read, None where they need none, and what is said of it."""
    if not stamps.dated:
        return None, f"{stamps.form} from the start"
    if stamps.offset:
        return None, "with an offset of its own"
    if keys.zone:
        return keys.zone, keys.zone
    for part in parts:  # tags may follow one another in the file, each with times of its own
        check_clock(part.stamps.clock, part.lines, file)
    return "UTC", "no zone given: read as UTC, a clock that is never changed"


def _signal(part: _Part, decimal: str, good: set[str], zone: str | None, file: Path) -> Signal:
    texts, codes, examples = part.texts, {}, {}
    unit = part.unit
    if not pd.api.types.is_numeric_dtype(texts.dtype):
        behind = unit_behind(texts)
        if behind and is_unit(behind):
            texts, unit = without_unit(texts, behind), unit or behind
    values = read_numbers(texts, decimal)
    present = np.isfinite(values)
    if not pd.api.types.is_numeric_dtype(texts.dtype):
        words = texts[(texts != "").to_numpy() & ~present]
        codes = {str(k): int(v) for k, v in words.value_counts().items()}
        examples = {str(k): int(part.lines[np.flatnonzero((texts == k).to_numpy())[0]]) for k in list(codes)[:50]}
        present |= (texts != "").to_numpy()
    poor = np.zeros(len(values), bool)
    if part.quality is not None:
        poor = np.isfinite(values) & ~part.quality.str.lower().isin(good).to_numpy()
        values = np.where(poor, np.nan, values)
    clock, lines = part.stamps.clock, part.lines
    time = clock if zone is None else to_utc(clock, zone, lines, file)
    keep = np.flatnonzero(present)
    order = keep[np.argsort(time[keep], kind="stable")]
    time, values, lines = time[order], values[order], lines[order]
    last, repeated = _last_of_each(time, values)
    return Signal(
        part.tag,
        unit,
        part.description,
        time[last],
        values[last],
        lines[last],
        codes,
        examples,
        int(poor.sum()),
        repeated,
    )


def _last_of_each(time: Instants, values: Any) -> tuple[Any, int]:
    """Positions of the last good value at each time (else the last one), and how many others differ from it."""
    if not len(time):
        return np.array([], int), 0
    group = np.concatenate([[0], np.cumsum(np.diff(time) != 0)])
    rank = np.lexsort((np.arange(len(time)), np.isfinite(values), group))
    last = rank[np.concatenate([np.flatnonzero(np.diff(group[rank])), [len(rank) - 1]])]
    chosen = values[last][group]
    differ = np.isfinite(values) & (values != chosen)
    return last, int(differ.sum())
