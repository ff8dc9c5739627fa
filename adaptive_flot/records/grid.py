"""From values at their own times to rows: inputs as they acted, outputs as they were measured, gaps as gaps.

Row k stands for the interval from t[k-1] to t[k], as in every record: its inputs acted during the interval, its outputs
are those at its end. An input acts from its stamp until the next one (zero-order hold), at most `hold_at_most` long.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.tables import MOST_ROWS
from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.records.clean import Cleaned
from adaptive_flot.records.reading.export import Instants

STATUSES = ("measured", "held", "averaged", "missing", "bad", "constant")
MEASURED, HELD, AVERAGED, MISSING, BAD, CONSTANT = range(len(STATUSES))
FEWEST_ROWS = 2
"""Rows of the shortest stretch that is kept."""
Codes = np.ndarray[Any, np.dtype[np.int8]]


@dataclass(frozen=True)
class Rows:
    """Rows on a grid.

    Attributes
    ----------
    time
        Times (N,) [ns since 1970, UTC]; within a stretch one step apart.
    step
        The step [ns].
    stretch
        Number of the stretch of each row (N,), from 1.
    values
        Values (N,) by quantity, in its unit; NaN where missing or bad.
    statuses
        Index into STATUSES (N,) by quantity.
    left_out
        Stretches too short to be kept.
    """

    time: Instants
    step: int
    stretch: Instants
    values: Mapping[str, FloatArray]
    statuses: Mapping[str, Codes]
    left_out: int = 0


def make_rows(
    inputs: Sequence[Cleaned], outputs: Sequence[Cleaned], step_s: float, hold_s: float, gaps: str, file: Path
) -> Rows:
    """Put the values of all quantities on one grid.

    Parameters
    ----------
    inputs, outputs
        Cleaned signals.
    step_s
        Sampling interval [s].
    hold_s
        Longest time [s] for which an input is held.
    gaps
        What happens where an input is missing: `split`, `longest` or `refuse`.
    file
        For messages.

    Raises
    ------
    DataError
        No time at which all inputs are known, a gap that is refused, or too many rows.
    """
    step, hold = round(step_s * 1e9), round(hold_s * 1e9)
    if step < 1 or hold < step:
        raise DataError(f"{file}: hold_at_most ({hold_s:g} s) is shorter than the step ({step_s:g} s); make it longer")
    slack = step // 1000
    moving = [c for c in inputs if not c.constant]
    end = max(int(c.time[c.good][-1]) for c in (*moving, *outputs))
    known = [(-(2**62), 2**62)]
    for c in moving:
        own = hold if c.keys.hold_s is None else round(c.keys.hold_s * 1e9)
        known = _both(known, _covered(c.time[c.good], own, end))
    anchor = _anchor(moving[0].time[moving[0].good], step)
    spans = []
    for a, b in known:
        first, last = -(-(a - slack - anchor) // step), (b + slack - anchor) // step
        spans += [(first, last)] if last > first else []
    whole = [(a, b) for a, b in spans if b - a >= FEWEST_ROWS]
    total = sum(b - a for a, b in whole)
    _check(whole, total, gaps, anchor, step, hold_s, moving, file)
    if gaps == "longest":
        whole = [max(whole, key=lambda s: s[1] - s[0])]
    edges = [anchor + step * np.arange(a, b + 1, dtype=np.int64) for a, b in whole]
    values: dict[str, FloatArray] = {}
    statuses: dict[str, Codes] = {}
    for cleaned, place in ((c, p) for group, p in ((inputs, _input), (outputs, _output)) for c in group):
        parts = [place(cleaned, e, step) for e in edges]
        values[cleaned.quantity.name] = np.concatenate([p[0] for p in parts])
        statuses[cleaned.quantity.name] = np.concatenate([p[1] for p in parts])
    return Rows(
        np.concatenate([e[1:] for e in edges]),
        step,
        np.concatenate([np.full(len(e) - 1, k, dtype=np.int64) for k, e in enumerate(edges, start=1)]),
        values,
        statuses,
        len(spans) - len(whole),
    )


def _covered(time: Instants, hold: int, end: int) -> list[tuple[int, int]]:
    """Spans in which a signal is known, its values held for so long at most, and not beyond the end of the export."""
    breaks = np.flatnonzero(np.diff(time) > hold + hold // 1000)
    starts = time[np.concatenate([[0], breaks + 1])]
    stops = np.minimum(time[np.concatenate([breaks, [len(time) - 1]])] + hold, end)
    return [(int(a), int(b)) for a, b in zip(starts, stops, strict=True)]


def _both(one: list[tuple[int, int]], other: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Intersection of two sorted lists of spans."""
    found, i, j = [], 0, 0
    while i < len(one) and j < len(other):
        a, b = max(one[i][0], other[j][0]), min(one[i][1], other[j][1])
        if a < b:
            found.append((a, b))
        if one[i][1] < other[j][1]:
            i += 1
        else:
            j += 1
    return found


def _anchor(time: Instants, step: int) -> int:
    """A time of the grid: such that a regular signal's stamps fall on it, whatever they jitter."""
    away = (time - time[0] + step // 2) % step - step // 2
    regular = np.ptp(np.quantile(away, (0.25, 0.75))) < step / 4
    middle = int(np.median(away)) if regular else 0
    return int(time[0]) + (middle if abs(middle) > step // 1000 else 0)


def _check(
    whole: list[tuple[int, int]],
    total: int,
    gaps: str,
    anchor: int,
    step: int,
    hold_s: float,
    inputs: Sequence[Cleaned],
    file: Path,
) -> None:
    if not whole:
        each = ", ".join(
            f"{c.quantity.name} {_shown(int(c.time[c.good][0]))} to {_shown(int(c.time[c.good][-1]))}" for c in inputs
        )
        raise DataError(
            f"{file}: no time at which all inputs are known for two steps of {step / 1e9:g} s ({each}); "
            "lengthen grid: hold_at_most in the map, or export all tags over one span"
        )
    if total > MOST_ROWS:
        raise DataError(f"{file}: {total} rows of {step / 1e9:g} s, and {MOST_ROWS} are allowed; give a longer step")
    if gaps == "refuse" and len(whole) > 1:
        at = _shown(anchor + step * whole[0][1])
        raise DataError(
            f"{file}: a gap: from {at} on an input has no value for over {hold_s:g} s ({len(whole) - 1} in all); "
            "write 'gaps: split' in the map, or export a span without one"
        )


def _shown(time: int) -> str:
    return str(np.datetime64(time // 10**9, "s")).replace("T", " ")


def _input(cleaned: Cleaned, edges: Instants, step: int) -> tuple[FloatArray, Codes]:
    """Values of an input over the intervals between edges: its held value, time-weighted where that changes inside.

    The mean of a held signal over an interval has the same integral, hence the same effect on a balance::

        u[k] = 1/step * sum_i v_i d_i,    d_i: how long v_i was held in the interval
    """
    if cleaned.constant:
        count = len(edges) - 1
        return np.full(count, cleaned.values[0]), np.full(count, CONSTANT, dtype=np.int8)
    time, held = cleaned.time[cleaned.good], cleaned.values[cleaned.good]
    slack = step // 1000
    at = np.searchsorted(time, edges[:-1] + slack, side="right") - 1
    until = np.searchsorted(time, edges[1:] - slack, side="left") - 1
    values = held[np.maximum(at, 0)].copy()
    fresh = edges[:-1] - time[np.maximum(at, 0)] < step - slack
    status = np.where(fresh, MEASURED, HELD).astype(np.int8)
    if (cleaned.keys.average or "interval") == "interval":
        changed = until > at
        if changed.any():
            inside = time[(time > edges[0]) & (time < edges[-1])]
            points = np.union1d(edges, inside)
            weight = np.diff(points).astype(float)
            place = np.searchsorted(edges, points[:-1], side="right") - 1
            acting = held[np.maximum(np.searchsorted(time, points[:-1] + slack, side="right") - 1, 0)]
            mean = np.bincount(place, acting * weight, len(values)) / np.bincount(place, weight, len(values))
            values[changed] = mean[changed]
            status[changed] = AVERAGED
    return values, status


def _output(cleaned: Cleaned, edges: Instants, step: int) -> tuple[FloatArray, Codes]:
    """Values of an output at the ends of the intervals: the nearest within half a step, or the mean of an interval."""
    count = len(edges) - 1
    time, measured = cleaned.time[cleaned.good], cleaned.values[cleaned.good]
    values, status = np.full(count, np.nan), np.full(count, MISSING, dtype=np.int8)
    others = cleaned.time[~cleaned.good]
    if cleaned.keys.average == "interval":
        number = _counts(time, edges)
        place = np.searchsorted(edges, time, side="left") - 1
        inside = (place >= 0) & (place < count)
        total = np.bincount(place[inside], measured[inside], count)
        values = np.where(number > 0, total / np.maximum(number, 1), np.nan)
        status[number == 1], status[number > 1] = MEASURED, AVERAGED
        status[(number == 0) & (_counts(others, edges) > 0)] = BAD
        return values, status
    at = edges[1:]
    after = np.clip(np.searchsorted(time, at), 0, len(time) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(time[after] - at) < np.abs(time[before] - at), after, before)
    near = 2 * np.abs(time[nearest] - at) < step
    values[near], status[near] = measured[nearest[near]], MEASURED
    status[~near & (_counts(others, np.concatenate([at[:1] - step, at]) + step // 2) > 0)] = BAD
    return values, status


def _counts(time: Instants, edges: Instants) -> Instants:
    """How many times lie in each interval, the end counted in."""
    places = np.searchsorted(time, edges, side="right")
    found: Instants = np.diff(places)
    return found
