"""What can be the matter at a site, by its role: one hypothesis is an effect with few coefficients and their starts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from adaptive_flot.discovery.candidates.turns import has_sign, turning, turns, turns_with
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site

Kind = Literal[
    "switch", "ramp", "periodic", "cycle", "stuck", "stuck for a time", "leaks", "gain", "offset", "span", "range",
    "sign", "lag", "hysteresis", "dead zone", "depends", "turns", "store", "alternative",
]  # fmt: skip
STRUCTURE = ("depends", "store", "sign")
"""What a plant has or has not: it does not come between a reference record and another one."""
SWITCHED = ("switch", "stuck for a time")
"""What is there between times, at once."""
EVENTS = (*SWITCHED, "ramp")
"""What begins at some time."""
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Levels at which a part may be stuck or leak, as shares of the range that its signal has been seen in."""
GAINS = (-2.0, -0.7, -0.2, 0.2, 0.7)
"""Starts of a constant factor, in its logarithm."""
STORES = (20.0, 100.0)
"""Time constants of a hidden store to start from, in sampling intervals."""
LAGS = (2.0, 10.0, 50.0)
"""Starts of a time constant, in sampling intervals. A slower sensor would show next to nothing of what happens."""
SLOPES = (-0.3, 0.3)
"""Starts of the logarithm of a factor from the lowest to the highest value of a driver."""
TURNS = (-2.0, -0.3, 0.3, 2.0)
"""Starts of what turns with the sign of a signal, as shares of a value's ordinary size."""
ENDS = (0.05, 0.95)
"""Quantiles of a driver between which a dependence is drawn as a straight line."""
WIDEST_SPAN = 0.3
"""Largest error of a sensor's span: one that hardly answers at all is stuck, not wrongly calibrated."""
WIDEST_OFFSET = 0.5
"""Largest constant error of a sensor or actuator, as a share of the range it has been seen in: one that is further off
has failed, which reads otherwise."""
LONGEST_LAG = 0.1
"""Longest time constant of a sensor, as a share of a record."""
MATTERS = 0.1
"""A change that matters, as a share of the range of a value: the scale of a fit."""
LEAST_MOVE = 1e-3
"""A driver that moves by a smaller share of its size can not be told from a constant."""
ROUNDING = 1e-3
"""Rounding of corners, as a share of the range of the value."""
FOREVER = 1e7
"""Duration [s] of what is switched on and stays on."""


@dataclass(frozen=True)
class Hypothesis:
    """One thing that may be the matter.

    Attributes
    ----------
    site, driver, kind
        Where it acts, what it depends on ("constant" where on nothing), and what it is.
    effect
        The effect, its amplitude at 1 where it is all or nothing.
    free
        Coefficients that are fitted.
    starts
        Values of these to start from; the best few are refined.
    limits
        Range of coefficients that is narrower than their form's.
    scales
        Size of a change of a coefficient that matters, where its form, which knows no unit, can not say it.
    """

    site: str
    driver: str
    kind: Kind
    effect: Effect
    free: tuple[str, ...]
    starts: tuple[Mapping[str, float], ...]
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Full names of the fitted coefficients."""
        return tuple(self.effect.parameter(c) for c in self.free)

    def with_scales(self, values: Mapping[str, float], mode: Mode) -> Hypothesis:
        """The same; a coefficient in seconds or in the unit of its site has the size of its value for a scale.

        Not where it has a scale, or is 0. Changes by a factor are as large at any site; `mode` is how effects act there
        by default.
        """
        own_unit = {"s", *self._of_site(mode)}
        sizes = {c.name: abs(values[c.name]) for c in self.effect.terms if c.unit in own_unit and c.name in values}
        return replace(self, scales={**{name: size for name, size in sizes.items() if size > 0}, **self.scales})

    def has_size_in_unit(self, mode: Mode) -> bool:
        """Whether a fitted coefficient is in the unit of its site; `mode` is how effects act there by default."""
        return any(c.unit in self._of_site(mode) for c in self.effect.terms if c.name in self.free)

    def _of_site(self, mode: Mode) -> set[str]:
        """Units of coefficients that stand for the unit of the site."""
        return {"value", "value/driver"} | ({"g"} if (self.effect.mode or mode) == "offset" else set())

    @property
    def pulses(self) -> tuple[tuple[float, float], ...]:
        """When an event is there and for how long [s], FOREVER where it stays; none of anything else."""
        if self.kind == "ramp":
            return ((self.effect.coefficients["onset"], FOREVER),)
        told = self.effect.coefficients if self.kind in SWITCHED else {}
        return tuple((told[c], told[c.replace("on_", "for_")]) for c in told if c.startswith("on_"))

    @property
    def label(self) -> str:
        """Name in tables: ``heating_valve leaks``."""
        by = f" by {self.driver}" if self.kind in ("depends", "turns", "store") else ""
        return f"{self.site} {self.kind}{by}"


def hypotheses(
    model: Model, seen: Mapping[str, FloatArray], drivers: Mapping[str, FloatArray], dt: float, duration: float
) -> tuple[Hypothesis, ...]:
    """Everything that the sites of a model allow, by their roles.

    Parameters
    ----------
    model
        The model, with sites.
    seen, drivers
        Values at each site and of each driver (N,), see `seen.py`. They are those of all records, so that a part
        that does not move in one of them has the range of the others.
    dt, duration
        Sampling interval and length of the longest record [s].
    """
    there = {e.label for e in model.effects}
    amounts = [h for site in model.sites if (h := _amount(model, site, seen)) is not None]
    each = [
        amounts,
        *(
            _at_site(model, site, seen[site.name], drivers, dt, duration)
            for site in model.sites
            if np.isfinite(seen[site.name]).all()
        ),
    ]
    return tuple(h for some in each for h in some if h.effect.label not in there)


def _at_site(
    model: Model, site: Site, v: FloatArray, drivers: Mapping[str, FloatArray], dt: float, duration: float
) -> Iterator[Hypothesis]:
    low, high = float(v.min()), float(v.max())
    spread, size = high - low, ordinary_size(v)
    moves = spread > LEAST_MOVE * max(size, 1e-300)
    if site.role == "actuator" and moves:
        yield from _stuck_or_leaking(site, low, spread)
        yield _limited(site, low, spread)
    if site.role == "sensor" and moves:
        if low < 0 < high or low >= 0:
            yield _sign(site, spread)
        yield _frozen(site, low, spread)
        if dt < LONGEST_LAG * duration:
            yield _lag(site, size, dt, LONGEST_LAG * duration)
        yield _span(site, float(np.median(v)), spread)
    if size > 0 and site.role != "sensor":
        yield _gain(site)
    if site.role in ("sensor", "actuator") and (spread > 0 or size > 0):
        yield _offset(site, spread or size)
    elif site.mode == "offset" and low < 0 < high:  # an amount is no factor of what goes both ways
        yield constant_amount(site, spread)
    if site.role in ("process", "flow", "feed"):
        for name, d in drivers.items():
            if np.quantile(d, ENDS[1]) - np.quantile(d, ENDS[0]) > LEAST_MOVE * float(np.median(np.abs(d))):
                yield _depends(site, name, d)
            if has_sign(model, name) and turns(d) and turns_with(v, d):
                yield _turns(site, name, d, size)
    if site.role == "flow":
        for state in model.states:
            if state.name in drivers:
                moved = float(np.ptp(drivers[state.name])) or 1.0
                yield _store(site, state.name, moved, spread or size, dt)


def _stuck_or_leaking(site: Site, low: float, spread: float) -> Iterator[Hypothesis]:
    levels, seen = tuple({"level": low + share * spread} for share in LEVELS), {"level": (low, low + spread)}
    stuck, size = Effect(site.name, "own_value", "stuck", {"amplitude": 1.0}), {"level": MATTERS * spread}
    yield Hypothesis(site.name, "own_value", "stuck", stuck, ("level",), levels, seen, size)
    effect = Effect(
        site.name, "own_value", "leak", {"amplitude": 1.0, "level": low}, {"width": ROUNDING * spread}
    )  # fmt: skip
    yield Hypothesis(site.name, "own_value", "leaks", effect, ("level",), levels[1:], seen, size)


def _frozen(site: Site, low: float, spread: float) -> Hypothesis:
    """A sensor that has stopped; its level may be anywhere."""
    effect = Effect(site.name, "own_value", "stuck", {"amplitude": 1.0})
    starts = tuple({"level": low + s * spread} for s in LEVELS)
    return Hypothesis(site.name, "own_value", "stuck", effect, ("level",), starts, {}, {"level": MATTERS * spread})


def _limited(site: Site, low: float, spread: float) -> Hypothesis:
    effect = Effect(
        site.name, "saturation", "saturation", {"amplitude": 1.0, "limit": low + spread}, {"width": ROUNDING * spread}
    )
    return Hypothesis(
        site.name,
        "saturation",
        "range",
        effect,
        ("limit",),
        tuple({"limit": low + s * spread} for s in (0.3, 0.6, 0.9)),
        {"limit": (low, low + spread)},
        {"limit": MATTERS * spread},
    )


def _sign(site: Site, spread: float) -> Hypothesis:
    effect = Effect(site.name, "own_value", "rectified", {}, {"width": ROUNDING * spread})
    return Hypothesis(site.name, "own_value", "sign", effect, ("amplitude",), ({"amplitude": 1.0},))


def _lag(site: Site, size: float, dt: float, longest: float) -> Hypothesis:
    effect = Effect(site.name, "lag", "lag", {"amplitude": 1.0}, {"scale": size or 1.0})
    starts = tuple({"time_constant": n * dt} for n in LAGS)
    limits, scales = {"time_constant": (dt, longest)}, {"time_constant": LAGS[1] * dt}
    return Hypothesis(site.name, "lag", "lag", effect, ("time_constant",), starts, limits, scales)


def span_limits(spread: float) -> dict[str, tuple[float, float]]:
    """Range of a calibration error at a site whose value has been seen over `spread`."""
    return {"slope": (-WIDEST_SPAN, WIDEST_SPAN), "offset": (-WIDEST_OFFSET * spread, WIDEST_OFFSET * spread)}


def offset_limits(spread: float) -> dict[str, tuple[float, float]]:
    """Range of a constant error at a site whose value has been seen over `spread`."""
    return {"amplitude": (-WIDEST_OFFSET * spread, WIDEST_OFFSET * spread)}


def _span(site: Site, middle: float, spread: float) -> Hypothesis:
    effect = Effect(site.name, "own_value", "span", settings={"middle": middle})
    starts = tuple({"offset": o * spread, "slope": s} for o in (-0.3, 0.3) for s in (-0.2, 0.2))
    return Hypothesis(
        site.name,
        "own_value",
        "span",
        effect,
        ("offset", "slope"),
        starts,
        span_limits(spread),
        {"offset": MATTERS * spread},
    )


def _gain(site: Site) -> Hypothesis:
    effect = Effect(site.name, "constant", "shift", mode="factor")
    return Hypothesis(site.name, "constant", "gain", effect, ("amplitude",), tuple({"amplitude": g} for g in GAINS))


def _offset(site: Site, spread: float) -> Hypothesis:
    effect = Effect(site.name, "constant", "shift", mode="offset")
    starts = tuple({"amplitude": s * spread} for s in (-0.3, 0.3))
    return Hypothesis(
        site.name,
        "constant",
        "offset",
        effect,
        ("amplitude",),
        starts,
        offset_limits(spread),
        {"amplitude": MATTERS * spread},
    )


def _amount(model: Model, site: Site, seen: Mapping[str, FloatArray]) -> Hypothesis | None:
    """A constant amount at a site of a balance whose own value is zero: a leak, a load, a heat that nobody counts.

    Its scale is the ordinary size of the other sites of its unit; none where there is none.
    """
    if site.role not in ("process", "flow", "feed") or site.mode != "offset" or np.any(seen[site.name] != 0):
        return None
    others = [s for s in model.sites if s.unit == site.unit and s.role != "sensor"]
    sizes = [ordinary_size(seen[s.name]) for s in others if np.isfinite(seen[s.name]).all()]
    size = max(sizes, default=0.0)
    return constant_amount(site, size) if size > 0 else None


def constant_amount(site: Site, size: float) -> Hypothesis:
    """A constant amount of any size that is added at a site; `size` is an ordinary one."""
    return replace(_offset(site, size), limits={})


def constant_change(site: Site, size: float) -> Hypothesis:
    """A constant change in the way of the site: a factor, or an amount of any size; `size` is an ordinary one."""
    return _gain(site) if site.mode == "factor" else constant_amount(site, size)


def _depends(site: Site, driver: str, d: FloatArray) -> Hypothesis:
    low, high = (float(np.quantile(d, q)) for q in ENDS)
    effect = Effect(site.name, driver, "curve", settings={"knots": (low, high)}, mode="factor")
    starts = tuple({"value_1": -slope, "value_2": slope} for slope in SLOPES)
    return Hypothesis(site.name, driver, "depends", effect, ("value_1", "value_2"), starts)


def _turns(site: Site, driver: str, d: FloatArray, size: float) -> Hypothesis:
    starts = tuple({"amplitude": 0.0, "turn": s * size} for s in TURNS)
    h = turned(site, driver, d, starts, {"amplitude": MATTERS * size, "turn": MATTERS * size})
    width = h.effect.coefficients["width"]
    started = tuple({**start, "width": width} for start in h.starts)
    return replace(h, free=(*h.free, "width"), starts=started)


def turned(
    site: Site, driver: str, d: FloatArray, starts: tuple[Mapping[str, float], ...], scales: Mapping[str, float]
) -> Hypothesis:
    """What turns with the sign of a signal (N,), as dry friction does: an amount that is added, not a factor."""
    effect = turning(site.name, driver, d, "offset")
    return Hypothesis(site.name, driver, "turns", effect, ("amplitude", "turn"), starts, {}, scales)


def _store(site: Site, state: str, moved: float, size: float, dt: float) -> Hypothesis:
    effect = Effect(site.name, state, "store")
    starts = tuple({"exchange": 0.3 * size / moved, "time_constant": n * dt} for n in STORES)
    scales = {"exchange": size / moved, "time_constant": STORES[-1] * dt}
    return Hypothesis(site.name, state, "store", effect, ("exchange", "time_constant"), starts, {}, scales)
