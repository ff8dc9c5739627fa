"""The catalogue of a search: for each site and driver the profiles that score it and the effects to fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from adaptive_flot.discovery.candidates.dynamics import BOUNDS, bounded, late
from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.candidates.spline import knots_of, spline_values, through
from adaptive_flot.discovery.candidates.turns import turning, turns
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.record.screening import LEAST_OF_SCALE, LEAST_RANGE
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS, LATE, STATELESS_DRIVERS, Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site

ONSETS = 18
"""Steps at this many onsets score an event in time."""
EDGE = 1e-3
"""Width of the edge of a step, as a share of the record: a fit has to see which way to move it."""
TIME_KNOTS = 7
DRIVER_KNOTS = 4
FINE_KNOTS = 8
FINE_TIME_KNOTS = 14
"""Knots of the curve of a finalist: a hard limit or a threshold must not be told apart from its site by its shape."""
SPILL_QUANTILES = (0.5, 0.7, 0.85, 0.95)
"""A spill is scored with its edge at these quantiles of the level."""


@dataclass(frozen=True)
class Candidate:
    """A site and a driver, known by name or not, with the variants that stand for it."""

    site: Site
    driver: str
    known: bool
    variants: tuple[Variant, ...]

    @property
    def name(self) -> tuple[str, str]:
        """Site and driver."""
        return self.site.name, self.driver


def catalogue(model: Model, responses: Responses) -> list[Candidate]:
    """All candidates of a model that the record can tell anything about.

    A driver that hardly moves is left out; lag and delay are those of sensors, actuators and feeds; what the model has
    already is not offered again, and a change that only rescales an adapted parameter neither.
    """
    taken = {(e.site, e.driver) for e in model.effects}
    time = responses.problem.record.time
    candidates = []
    signals = {s.name for s in model.signals} - set(model.late_drivers)
    for site in model.sites:
        unknown = signals - set(site.signals)  # defined further down: no effect here can depend on it
        for driver in ("constant", "time", *responses.drivers, "lag", "delay", *BOUNDS):
            if (site.name, driver) in taken or driver in unknown or not _makes_sense(site, driver):
                continue
            variants = tuple(_variants(site, driver, time, responses))
            if site.role == "sensor" and driver not in DYNAMIC_DRIVERS:
                # the other kind of error: a gain where an offset is usual, an offset where a gain is
                either = [v for v in variants if v.effect.family.is_constant or v.effect.family.is_curve]
                variants += tuple(_otherwise(v, site) for v in either)
            absorbed = responses.problem.absorbed
            variants = tuple(v for v in variants if not _is_absorbed(v, site, absorbed))
            if variants:
                candidates.append(Candidate(site, driver, nameable(model, site, driver), variants))
    return candidates


def _is_absorbed(variant: Variant, site: Site, absorbed: frozenset[tuple[str, str]]) -> bool:
    """Whether a variant is a constant change that adapted parameters take up."""
    return variant.effect.family.is_constant and (site.name, variant.effect.mode or site.mode) in absorbed


def _makes_sense(site: Site, driver: str) -> bool:
    if driver in LATE:
        return site.role in ("sensor", "actuator", "feed") and site.passed == 1
    if driver in BOUNDS:  # a sensor at its limit shows in the data screening
        return site.role == "actuator" and site.passed == 1
    return True


def nameable(model: Model, site: Site, driver: str) -> bool:
    """Whether a pair may be named: a table of the model lists it, or it needs no table."""
    return any((k.site, k.driver) == (site.name, driver) for k in model.known_effects) or has_a_reason(
        model, site, driver
    )


def has_a_reason(model: Model, site: Site, driver: str) -> bool:
    """Whether a pair that no table lists may be named all the same.

    A quantity of the process may depend on anything in it. A sensor, an actuator or a feed has no reason to depend on
    the state of the cell; such a dependence is reported as a curve without a name. So is that of a flow, whose law is
    a matter of its own store, where the model has a table. Without a table, a valve may be no straight line of its own
    command, and a sensor none of what it measures.
    """
    if driver in STATELESS_DRIVERS or site.role == "process":
        return True
    if model.known_effects:
        return False
    return site.role == "flow" or passed_on(model).get(site.name) == driver


def passed_on(model: Model) -> Mapping[str, str]:
    """The input or state, by site, that the value there is a function of, where it is one of no other."""
    return model.derived(_passed_on)


def _passed_on(model: Model) -> dict[str, str]:
    """The input or state that the value at a site is a function of, where it is one of no other."""
    names = (*model.names("states"), *model.names("inputs"), *model.names("algebraic"))
    on = np.hstack([np.array(ca.DM(model.site_values.jac_sparsity(0, k), 1)) for k in (1, 2, 4)]) != 0
    alone = {site.name: row for site, row in zip(model.sites, on, strict=True) if row.sum() == 1}
    return {site: names[int(np.argmax(row))] for site, row in alone.items()}


def _variants(site: Site, driver: str, time: FloatArray, responses: Responses) -> Iterator[Variant]:
    offset = site.mode == "offset"
    ones = np.ones(len(time))

    def profile(values: FloatArray) -> TimeProfile:
        return TimeProfile(site.name, values, offset)

    if driver == "constant":
        yield Variant(Effect(site.name, driver, "shift"), (profile(ones),), ("amplitude",))
    elif driver == "time":
        yield from _in_time(site, time, offset)
    elif driver in LATE:
        yield from late(site, driver, responses)
    elif driver in BOUNDS:
        yield from bounded(site, driver, responses)
    else:
        model = responses.fit.model
        quantity = next(q for q in (*model.inputs, *model.states, *model.signals) if q.name == driver)
        if quantity.zero_is_arbitrary:
            yield from _on_signed(site, driver, responses.drivers[driver], offset, LEAST_OF_SCALE * quantity.scale)
        else:
            yield from _on_signal(site, driver, responses.drivers[driver], offset, model.names("states"))


def _otherwise(variant: Variant, site: Site) -> Variant:
    """The same profile as a factor where the site's own way is an offset, and the other way round."""
    effect = replace(variant.effect, mode="factor" if site.mode == "offset" else "offset")
    profiles = tuple(replace(c, offset=not c.offset) for c in variant.profiles)
    return replace(variant, effect=effect, profiles=profiles)


def _in_time(site: Site, time: FloatArray, offset: bool) -> Iterator[Variant]:
    low, high = float(time[0]), float(time[-1])
    span = high - low
    onsets = np.linspace(low, high, ONSETS + 2)[1:-1]
    for onset in onsets:
        yield event(site, "step", time, float(onset), 0.0, offset)
    for duration in (0.15 * span, 0.4 * span):
        for onset in onsets[:-2:3]:
            yield event(site, "ramp", time, float(onset), duration, offset)
    for onset in onsets[:-2:3]:
        yield event(site, "washout", time, float(onset), 0.1 * span, offset)
    knots = tuple(float(k) for k in np.linspace(low, high, TIME_KNOTS))
    yield _curve(site, "time", time, knots, offset)


def event(site: Site, form: str, time: FloatArray, onset: float, length: float, offset: bool) -> Variant:
    """A step, ramp or washout at a site, from an onset; `length` is the ramp's duration or the time constant [s]."""
    since = np.maximum(time - onset, 0)
    settings: dict[str, float] = {}
    start: tuple[tuple[str, float], ...] = (("onset", onset),)
    if form == "step":
        values = (time >= onset).astype(float)
        settings["width"] = EDGE * float(time[-1] - time[0])
    elif form == "ramp":
        values = np.minimum(since / length, 1)
        start += (("duration", length),)
    else:
        values = 1 - np.exp(-since / length)
        start += (("time_constant", length),)
    effect = Effect(site.name, "time", form, settings=settings)
    return Variant(effect, (TimeProfile(site.name, values, offset),), ("amplitude",), start)


def _on_signal(site: Site, driver: str, values: FloatArray, offset: bool, states: Sequence[str]) -> Iterator[Variant]:
    reference = float(np.median(values))
    spread = float(np.quantile(values, 0.98) - np.quantile(values, 0.02))
    if turns(values):
        yield _direction(site, driver, values, offset)
    if not reference > 0 or float(np.quantile(values, 0.02)) < 0:  # no power of a negative number
        yield from _on_signed(site, driver, values, offset, LEAST_RANGE * float(np.mean(np.abs(values))))
        return
    if not spread > LEAST_RANGE * reference:
        return
    ones = np.ones(len(values))
    logs = np.log(np.maximum(values / reference, 1e-6))
    settings = {"reference": reference}
    columns = TimeProfile(site.name, ones, offset), TimeProfile(site.name, logs, offset)
    yield Variant(Effect(site.name, driver, "power", settings=settings), columns, ("amplitude", "exponent"))
    knots = _knots(values)
    if knots is not None:
        yield _curve(site, driver, values, knots, offset)
    if site.role == "flow" and driver in states:
        yield from _spills(site, driver, values)


def _on_signed(site: Site, driver: str, values: FloatArray, offset: bool, least: float) -> Iterator[Variant]:
    """A straight line and a curve over a signal of which no power makes sense, if it spreads by more than the `least`.

    It is off most of the time, changes its sign, or is a temperature.
    """
    low, high = (float(q) for q in np.quantile(values, [0.02, 0.98]))
    if not high - low > least:
        return
    yield _curve(site, driver, values, (low, high), offset)
    knots = _knots(values)
    if knots is not None:
        yield _curve(site, driver, values, knots, offset)
        yield _cubic(site, driver, values, (low, high), offset)


def _cubic(site: Site, driver: str, values: FloatArray, ends: tuple[float, float], offset: bool) -> Variant:
    """A cubic law, as of a spring that hardens: it bends the most at the ends, where a natural spline is straight."""
    effect = Effect(site.name, driver, "cubic", settings={"knots": ends})
    z = (2 * values - ends[0] - ends[1]) / (ends[1] - ends[0])
    columns = tuple(TimeProfile(site.name, z**k, offset) for k in range(4))
    return Variant(effect, columns, ("amplitude", "slope", "square", "cube"))


def _direction(site: Site, driver: str, values: FloatArray, offset: bool) -> Variant:
    told = turning(site.name, driver, values)
    width = told.coefficients["width"]
    effect = replace(told, coefficients={})
    columns = (TimeProfile(site.name, v, offset) for v in (np.ones(len(values)), np.tanh(values / width)))
    return Variant(effect, tuple(columns), ("amplitude", "turn"), (("width", width),))


def _spills(site: Site, driver: str, values: FloatArray) -> Iterator[Variant]:
    """A flow from a store may be larger than its law says, and take what stands above an edge."""
    effect = Effect(site.name, driver, "overflow")
    for share in SPILL_QUANTILES:
        edge = float(np.quantile(values, share))
        above = np.maximum(values - edge, 0)
        profiles = TimeProfile(site.name, values, True), TimeProfile(site.name, above, True)
        yield Variant(effect, profiles, ("slope", "gain"), (("threshold", edge),))


def _knots(values: FloatArray) -> tuple[float, ...] | None:
    """Knots at evenly spaced values between the ends of what the record covers."""
    low, high = np.quantile(values, [0.02, 0.98])
    knots = np.linspace(low, high, DRIVER_KNOTS)
    counts = np.histogram(values, knots)[0]
    return tuple(float(k) for k in knots) if np.all(counts > 0.02 * len(values)) else None


def finer(variant: Variant, start: Mapping[str, float]) -> tuple[Variant, dict[str, float]] | None:
    """The same curve with more knots, and the start values that draw the coarse one; None for others and for a line."""
    effect = variant.effect
    if not effect.family.is_curve:
        return None
    coarse = knots_of(effect)
    if len(coarse) == 2:
        return None
    count = FINE_TIME_KNOTS if effect.driver == "time" else FINE_KNOTS
    knots = np.linspace(coarse[0], coarse[-1], count)
    values = spline_values(knots, coarse) @ [start[f"value_{k + 1}"] for k in range(len(coarse))]
    return through(effect, knots, values)


def _curve(site: Site, driver: str, values: FloatArray, knots: tuple[float, ...], offset: bool) -> Variant:
    effect = Effect(site.name, driver, "curve", settings={"knots": knots})
    basis = spline_values(values, knots)
    names = tuple(f"value_{k + 1}" for k in range(len(knots)))
    return Variant(effect, tuple(TimeProfile(site.name, b, offset) for b in basis.T), names)
