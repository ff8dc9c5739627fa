"""What an import did, as rows of words: raw beside converted values, and what becomes of holes and bad values."""

from __future__ import annotations

import numpy as np

from adaptive_flot.records.clean import FATES, Cleaned
from adaptive_flot.records.importing import Imported
from adaptive_flot.records.units import seconds

REASONS = dict(
    zip(
        FATES[1:],
        ("bad codes", "bad quality", "outside the physical range", "frozen values", "spikes"),
        strict=True,
    )
)


def converted(imported: Imported) -> list[tuple[str, str, str, str]]:
    """Quantity, tag, raw values and values of the record; median, and range of the good ones."""
    return [
        (
            c.quantity.name,
            c.keys.tag,
            f"{_range(c.raw[c.good])} {_unit(c.unit)}",
            f"{_range(c.values[c.good])} {_unit(c.quantity.unit)}",
        )
        for c in imported.cleaned
    ]


def done(imported: Imported) -> list[tuple[str, str]]:
    """Quantity, and what is done with its values, in words."""
    return [(c.quantity.name, _done(imported, c)) for c in imported.cleaned]


def _done(imported: Imported, c: Cleaned) -> str:
    grid = imported.tag_map.grid
    if c.constant:
        return "not recorded: the constant of the map in every row"
    if imported.is_input(c.quantity.name):
        held = c.keys.hold_at_most or grid.hold_at_most
        what = {"split": "a gap splits the record", "longest": "the longest stretch is kept", "refuse": "refused"}
        said = [f"held up to {held}, then missing: {what[grid.gaps]}"]
    elif c.keys.average == "interval":
        said = [f"mean of each {grid.step}"]
    else:
        said = ["value nearest to each row within half a step, else missing"]
    if c.keys.delay:
        said.append(f"stamps {c.keys.delay} earlier")
    counts = [f"{REASONS[f]} ({c.count(f)})" for f in FATES[1:] if c.count(f)]
    counts += [f"repeats of a held value ({c.repeats})"] if c.repeats else []
    counts += [f"values that a later row of the same time replaces ({c.repeated})"] if c.repeated else []
    if counts:
        said.append(f"left out: {', '.join(counts)}")
    return "; ".join(said)


def result(imported: Imported) -> str:
    """Rows, step, stretches, in a sentence."""
    rows = imported.rows
    step = seconds(imported.tag_map.grid.step or "")
    stretches = int(rows.stretch[-1])
    text = f"{len(rows.time)} rows, one every {step:g} s"
    if stretches > 1:
        longest = int(np.bincount(rows.stretch).max())
        text += f", in {stretches} stretches with gaps between them (the longest: {longest} rows)"
    if rows.left_out:
        text += f"; {rows.left_out} stretches of fewer than 2 rows left out"
    return text


def _range(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    low, middle, high = (f"{v:.4g}" for v in (values.min(), np.median(values), values.max()))
    return middle if low == high else f"{middle} ({low} to {high})"


def _unit(unit: str) -> str:
    return "" if unit == "-" else unit
