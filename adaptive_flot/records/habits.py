"""What an import does with a signal by default, from how it behaves: its step, holes, codes, repeats and spikes."""

from __future__ import annotations

import numpy as np

from adaptive_flot.errors import DataError, located
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.quantities import FloatArray, Quantity
from adaptive_flot.records.clean import runs_of_equal, spikes
from adaptive_flot.records.reading.export import Export, Signal
from adaptive_flot.records.tag_map import TagMap
from adaptive_flot.records.units import convert, seconds

SENTINELS = (-9999.0, 9999.0, -999.0, 999.0, -99.0, -99.9, -999.25, 99999.0, -99999.0, 65535.0, 32767.0, -32768.0)
"""Numbers that loggers write for no value; they count as such only outside the physical range."""
MOST_CODES = 10
"""Texts among the numbers of a tag, beyond which it is no column of numbers."""
STEPS_HELD = 3
LONG_RUN = 30
"""So many equal values, where a signal else changes, are a frozen sensor (as in discovery's data screening)."""
NICE = (1, 2, 3, 5, 6, 10, 12, 15, 20, 30, 60, 120, 300, 600, 900, 1800, 3600)
"""Steps [s] for tags that are stored as they change."""
SURE, NEARLY = 3.0, 1e-3
"""A step is a round one within so many standard errors of the mean, and within such a share."""
REGULAR = 0.5
"""Largest deviation of a step from the usual one, as a share, that is no hole."""


def complete_habits(export: Export, model: Model, known: TagMap) -> TagMap:
    """Complete bad codes, repeats, spikes and the grid of a map whose tags and units are known.

    Raises
    ------
    DataError
        A tag with too many texts among its numbers, or with fewer than two values.
    """
    inputs = set(model.names("inputs"))
    for q in (*model.inputs, *model.outputs):
        keys = known.quantities.get(q.name)
        if keys is None:
            continue
        signal = export.signals[keys.tag]
        more: dict[str, object] = {}
        given = keys.model_fields_set
        if "bad" not in given:
            with located(f"{export.file}: {q.name}: tag {keys.tag!r}"):
                codes = bad_codes(signal, q, keys.unit or q.unit, export)
            more |= {"bad": codes} if codes else {}
        if q.name not in inputs:
            values = signal.values[np.isfinite(signal.values) & ~np.isin(signal.values, _numbers(more.get("bad")))]
            if "repeats" not in given and holds_its_value(values):
                more["repeats"] = "drop"
            elif "frozen" not in given and _freezes(values):
                more["frozen"] = f"{LONG_RUN * period(signal)[0]:.6g} s"
            if (
                "spikes" not in given
                and more.get("repeats", keys.repeats) == "keep"
                and 0 < spikes(values).mean() < 0.02
            ):
                more["spikes"] = "drop"
        known = known.with_keys(q.name, more) if more else known
    return _grid(export, model, known)


def _numbers(codes: object) -> list[float]:
    listed = codes if isinstance(codes, list) else []
    return [float(c) for c in listed if c.replace(".", "", 1).lstrip("-").isdigit()]


def bad_codes(signal: Signal, q: Quantity, unit: str, export: Export) -> list[str]:
    """Texts among the numbers of a tag, and numbers of loggers outside the physical range."""
    if len(signal.codes) > MOST_CODES:
        shown = ", ".join(repr(c) for c in list(signal.codes)[:3])
        raise DataError(
            f"{export.file}: {q.name}: tag {signal.tag!r} has {len(signal.codes)} texts among its numbers ({shown}, "
            "...); is it the right tag? If so, list them in the map as bad"
        )
    there = np.unique(signal.values[np.isin(signal.values, SENTINELS)])
    inside = convert(there, unit, q.unit)
    outside = there[~((inside >= q.lower) & (inside <= q.upper))]
    return [*signal.codes, *(f"{v:g}" for v in outside)]


def holds_its_value(values: FloatArray) -> bool:
    """Whether a signal repeats most values, in runs of three and more, as an analyser that holds between assays."""
    if len(values) < 10 or np.ptp(values) == 0:
        return False
    runs = runs_of_equal(values)
    inside = sum(b - a for a, b in runs)
    return inside > 0.6 * len(values) and float(np.median([b - a for a, b in runs])) >= 3 and len(runs) >= 3


def _freezes(values: FloatArray) -> bool:
    runs = runs_of_equal(values)
    still = sum(b - a for a, b in runs if b - a >= LONG_RUN)
    rest = sum(b - a for a, b in runs if b - a < LONG_RUN)
    moving = len(values) - still
    return still > 0 and moving > 0.2 * len(values) and rest < 0.5 * moving


def period(signal: Signal) -> tuple[float, bool]:
    """Usual time between two values [s], and whether the signal is regular.

    Of a regular signal it is the mean step without holes: 3.04 s, where stamps are in whole seconds. It is 60 s where
    stamps jitter by some seconds, and the mean of some thousand is 59.99 s.

    Raises
    ------
    DataError
        Fewer than two values.
    """
    good = np.isfinite(signal.values)
    steps = np.diff(signal.time[good]) / 1e9
    if not len(steps):
        raise DataError(f"tag {signal.tag!r} has {int(good.sum())} value; a record needs at least 2")
    middle = float(np.median(steps))
    near = np.abs(steps - middle) <= REGULAR * middle
    if near.mean() < 0.8:
        return middle, False
    mean = float(np.mean(steps[near]))
    if abs(mean - middle) < 1e-4 * middle:
        return middle, True
    # stamps that jitter tell the step no better than this
    unsure = min(SURE * float(np.std(steps[near])) / np.sqrt(near.sum()), NEARLY * mean)
    return next((float(n) for n in NICE if abs(mean - n) <= unsure), mean), True


def _grid(export: Export, model: Model, known: TagMap) -> TagMap:
    """Step: that of the fastest regular input, else a round one for the fastest. Held for three steps."""
    moving = [q for q in model.inputs if q.name not in known.constants]
    inputs = [export.signals[known.quantities[q.name].tag] for q in moving]
    with located(str(export.file)):
        found = {s.tag: period(s) for s in inputs}
    if known.grid.step is None:
        regular = [p for p, even in found.values() if even]
        fastest = min(regular) if regular else min(p for p, _ in found.values())
        step = fastest if regular else next((float(n) for n in NICE if n >= fastest), fastest)
        known = known.with_keys("grid", {"step": f"{step:.6g} s"})
    step_s = seconds(known.grid.step or "")
    if known.grid.hold_at_most is None:
        known = known.with_keys("grid", {"hold_at_most": f"{STEPS_HELD * step_s:.6g} s"})
    held = seconds(known.grid.hold_at_most or "")
    for q, signal in zip(moving, inputs, strict=True):
        usual, even = found[signal.tag]
        keys = known.quantities[q.name]
        if keys.hold_at_most is None and (not even or usual > held / 1.5):
            steps = np.diff(signal.time[np.isfinite(signal.values)]) / 1e9
            longest = float(np.max(steps) if len(steps) < 100 or not even else np.quantile(steps, 0.99))
            known = known.with_keys(q.name, {"hold_at_most": f"{max(1.5 * longest, held):.6g} s"})
    return known
