"""What each family would change at a site along a record: courses of its value, for a regression."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from adaptive_flot.discovery.candidates.catalogue import nameable
from adaptive_flot.discovery.candidates.dynamics import dragged
from adaptive_flot.discovery.candidates.turns import has_sign, turns, turns_with
from adaptive_flot.discovery.hypotheses.families import (
    ENDS,
    LEAST_MOVE,
    MATTERS,
    ROUNDING,
    Hypothesis,
    Kind,
    offset_limits,
    span_limits,
    turned,
)
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.discovery.record.slip_jump import asked_from_outside, jumping
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site

BANDS = (0.01, 0.02, 0.04, 0.08, 0.15, 0.3)
"""Half widths of a dead band that are tried, as shares of the range of the value."""
FASTEST, SLOWEST, MOST_PERIODS = 8, 5, 200
"""Fewest rows of a period, fewest periods in a record, and most periods that are tried, one a period more a record."""
FOLLOWS = 0.5
"""Time constant by which an actuator follows once it moves, in sampling intervals."""
LEVELS = np.linspace(0.0, 1.0, 11)
"""Levels at which a part may be stuck, leak or end, as shares of the range of its value."""
LAGS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Time constants and dead times that are tried, in sampling intervals."""
STAGES = 6
"""Equal lags in a row that stand for a dead time in the filter: each is a state more of its covariance."""
STORES = (10.0, 30.0, 100.0, 300.0, 1000.0)
"""Time constants of a hidden store, likewise."""
LONGEST = 0.1
"""Longest time constant of a lag, as a share of the record. A store may be as slow as the record is long: it begins at
rest with its state, and is then what has been left behind."""


@dataclass(frozen=True)
class Suspect:
    """A hypothesis with the course that it gives to a site.

    Attributes
    ----------
    hypothesis
        The hypothesis; its effect holds what is not linear (levels, time constants).
    courses
        Change of the value for a coefficient of 1 each (n, f).
    coefficients
        Names of the coefficients that the regression finds (f,); empty where the change is all or nothing.
    shapes
        Number of further numbers that were chosen from a grid.
    """

    hypothesis: Hypothesis
    courses: FloatArray
    coefficients: tuple[str, ...]
    shapes: int = 0

    @property
    def cost(self) -> int:
        """Numbers that were fitted."""
        return len(self.coefficients) + self.shapes


def suspects(
    model: Model, values: Mapping[str, FloatArray], drivers: Mapping[str, FloatArray], dt: float
) -> Iterator[Suspect]:
    """Yield everything but changes in time that sites allow by their role.

    Parameters
    ----------
    model
        The model.
    values, drivers
        Value at each site and of each driver, an interval each (n,).
    dt
        Sampling interval [s].
    """
    taken = {e.label for e in model.effects}
    for site in model.sites:
        v = values[site.name]
        if not np.isfinite(v).all():
            continue
        for suspect in _at_site(model, site, v, drivers, dt):
            if suspect.hypothesis.effect.label not in taken and np.abs(suspect.courses).max() > 0:
                yield suspect


def periodic(
    site: Site, value: FloatArray, time: FloatArray, dt: float, period: float | None = None
) -> Iterator[Suspect]:
    """Yield sines and cosines of time at a site: of many periods, or of one that is known.

    Parameters
    ----------
    site, value
        The site, and its value in each interval (n,).
    time
        Time of the row at the end of each interval (n,) [s].
    dt
        Sampling interval [s].
    period
        The period [s], where it is known.
    """
    n, free = len(value), ("sine", "cosine")
    by = value if site.mode == "factor" else np.ones(n)
    if not np.isfinite(by).all() or not np.abs(by).max() > 0:
        return
    t = time if site.role == "sensor" else time - dt / 2
    many = (n * dt / count for count in range(SLOWEST, min(n // FASTEST, SLOWEST + MOST_PERIODS) + 1))
    for each in many if period is None else (period,):
        effect = Effect(site.name, "time", "periodic", {"period": each}, mode=site.mode)
        hypothesis = Hypothesis(site.name, "time", "periodic", effect, (*free, "period"), ({},))
        angle = 2 * np.pi * t / each
        yield Suspect(hypothesis, by[:, None] * np.column_stack([np.sin(angle), np.cos(angle)]), free, 1)


def _at_site(
    model: Model, site: Site, v: FloatArray, drivers: Mapping[str, FloatArray], dt: float
) -> Iterator[Suspect]:
    low, high = float(v.min()), float(v.max())
    spread, size = high - low, ordinary_size(v)
    if spread > LEAST_MOVE * max(size, 1e-300):
        if site.role in ("actuator", "sensor"):
            yield from _stuck_or_late(site.name, v, size, dt)
        if site.role == "actuator":
            yield from _leaks_or_ends(site.name, v)
            yield from _sticks_or_idles(site.name, v, size, dt)
            if site.name in asked_from_outside(model):
                yield from _jumps(site.name, v, size, dt)
        if site.role == "sensor":
            yield from _wrong_scale(site.name, v)
    yield from _constant(site, v, spread)
    if site.role in ("process", "flow", "feed"):
        by = v if site.mode == "factor" else np.ones_like(v)
        for driver, d in drivers.items():
            if driver in _known_at(model) and nameable(model, site, driver):
                yield from _depends(site, driver, d, by)
                if has_sign(model, driver) and turns(d) and (site.mode == "offset" or turns_with(v, d)):
                    yield _turns(site, driver, d)
        for state in model.states:
            if site.role == "flow" and state.name in drivers and "." not in state.name:
                yield from _stores(site, state.name, drivers[state.name], v, dt)


def _stuck_or_late(site: str, v: FloatArray, size: float, dt: float) -> Iterator[Suspect]:
    """What a sensor and an actuator have in common: one level for all that is asked, a lag or a dead time."""
    for level in v.min() + LEVELS * np.ptp(v):
        told = {"amplitude": 1.0, "level": float(level)}
        yield _fixed(Effect(site, "own_value", "stuck", told), "stuck", "level", level - v, MATTERS * float(np.ptp(v)))
    for tau in (intervals * dt for intervals in LAGS):
        if tau <= LONGEST * len(v) * dt:
            told = {"amplitude": 1.0, "time_constant": tau}
            effect = Effect(site, "lag", "lag", told, {"scale": size or 1.0})
            yield _fixed(effect, "lag", "time_constant", _lagged(v, tau, dt) - v, tau)
    for rows in map(int, LAGS):
        if rows <= LONGEST * len(v):
            told = {"amplitude": 1.0, "dead_time": rows * dt}
            effect = Effect(site, "delay", "delay", told, {"scale": size or 1.0, "stages": float(STAGES)})
            late = np.concatenate([np.full(rows, v[0]), v[:-rows]])
            yield _fixed(effect, "lag", "dead_time", late - v, rows * dt)


def _leaks_or_ends(site: str, v: FloatArray) -> Iterator[Suspect]:
    """An actuator that lets something through when closed, or does not open fully."""
    low, spread = float(v.min()), float(np.ptp(v))
    width = {"width": ROUNDING * spread}
    for level in low + LEVELS[1:] * spread:
        told = {"amplitude": 1.0, "level": float(level)}
        yield _fixed(
            Effect(site, "own_value", "leak", told, width), "leaks", "level", np.maximum(v, level) - v, MATTERS * spread
        )
    for limit in low + LEVELS[1:-1] * spread:
        told = {"amplitude": 1.0, "limit": float(limit)}
        yield _fixed(
            Effect(site, "saturation", "saturation", told, width),
            "range",
            "limit",
            np.minimum(v, limit) - v,
            MATTERS * spread,
        )


def _sticks_or_idles(site: str, v: FloatArray, size: float, dt: float) -> Iterator[Suspect]:
    """An actuator that moves only when asked to by more than a band, or that does nothing about its zero."""
    spread = float(np.ptp(v))
    settings = {"scale": size or 1.0, "follow_s": FOLLOWS * dt}
    for band in (share * spread for share in BANDS):
        told = {"amplitude": 1.0, "band": band}
        yield _fixed(
            Effect(site, "lag", "stiction", told, settings),
            "hysteresis",
            "band",
            dragged(v, band) - v,
            MATTERS * spread,
        )
        if v.min() < 0 < v.max():
            told = {"amplitude": 1.0, "centre": 0.0, "half_width": band}
            course = -np.clip(v, -band, band)
            yield _fixed(
                Effect(site, "own_value", "dead_zone", told), "dead zone", "half_width", course, MATTERS * spread
            )


def _jumps(site: str, v: FloatArray, size: float, dt: float) -> Iterator[Suspect]:
    """An actuator that stays until it is asked to move by more than a band, and then jumps to what is asked."""
    scale, settings = MATTERS * float(np.ptp(v)), {"scale": size or 1.0, "interval_s": dt}
    for jump in jumping(v):
        free = ("band", "rest") if jump.rest else ("band",)
        told = {"amplitude": 1.0, "band": jump.band, "rest": jump.rest}
        effect, limits = Effect(site, "lag", "slip_jump", told, settings), {"band": jump.bands}
        hypothesis = Hypothesis(site, "lag", "hysteresis", effect, free, ({},), limits, dict.fromkeys(free, scale))
        yield Suspect(hypothesis, (jump.position - v)[:, None], (), len(free))


def _wrong_scale(site: str, v: FloatArray) -> Iterator[Suspect]:
    """A sensor that does not see the sign, or whose zero and span are off."""
    spread = float(np.ptp(v))
    if v.min() < 0 < v.max():
        effect = Effect(site, "own_value", "rectified", {"amplitude": 1.0}, {"width": ROUNDING * spread})
        yield _fixed(effect, "sign", "amplitude", np.abs(v) - v, 1.0)
    middle = float(np.median(v))
    effect = Effect(site, "own_value", "span", settings={"middle": middle})
    hypothesis = Hypothesis(site, "own_value", "span", effect, ("offset", "slope"), ({},), span_limits(spread))
    yield Suspect(hypothesis, np.column_stack([np.ones_like(v), v - middle]), ("offset", "slope"))


def _constant(site: Site, v: FloatArray, spread: float) -> Iterator[Suspect]:
    """A constant error: added at sensors, actuators and balances, a factor elsewhere.

    An element's error is limited by what has been seen of it. What enters a balance is not: it may be nothing in the
    model.
    """
    free, size = ("amplitude",), ordinary_size(v)
    element = site.role in ("sensor", "actuator")
    if element or site.mode == "offset":
        effect = Effect(site.name, "constant", "shift", mode="offset")
        limits = offset_limits(spread or size) if element and (spread or size) > 0 else {}
        hypothesis = Hypothesis(site.name, "constant", "offset", effect, free, ({},), limits)
        yield Suspect(hypothesis, np.ones((len(v), 1)), free)
    if site.role != "sensor" and site.mode == "factor" and size > 0:
        effect = Effect(site.name, "constant", "shift", mode="factor")
        yield Suspect(Hypothesis(site.name, "constant", "gain", effect, free, ({},)), v[:, None], free)


def _known_at(model: Model) -> set[str]:
    names = model.drivers or (*model.names("inputs"), *model.names("states"))
    return {n for n in names if "." not in n}


def _depends(site: Site, driver: str, d: FloatArray, by: FloatArray) -> Iterator[Suspect]:
    low, high = (float(np.quantile(d, q)) for q in ENDS)
    if high - low <= LEAST_MOVE * float(np.median(np.abs(d))) or high <= low:
        return
    line = (d - low) / (high - low)
    effect = Effect(site.name, driver, "curve", settings={"knots": (low, high)}, mode=site.mode)
    yield Suspect(
        Hypothesis(site.name, driver, "depends", effect, ("value_1", "value_2"), ({},)),
        by[:, None] * np.column_stack([1 - line, line]), ("value_1", "value_2"),
    )  # fmt: skip


def _turns(site: Site, driver: str, d: FloatArray) -> Suspect:
    hypothesis = turned(site, driver, d, ({},), {})
    width = hypothesis.effect.coefficients["width"]
    return Suspect(hypothesis, np.column_stack([np.ones_like(d), np.tanh(d / width)]), hypothesis.free)


def _stores(site: Site, state: str, x: FloatArray, v: FloatArray, dt: float) -> Iterator[Suspect]:
    for intervals in STORES:
        tau = intervals * dt
        if tau > len(v) * dt:
            break
        effect = Effect(site.name, state, "store", {"exchange": 0.0, "time_constant": tau})
        h = _lagged(x, tau, dt)
        yield Suspect(
            Hypothesis(site.name, state, "store", effect, ("exchange", "time_constant"), ({},)),
            (x - h)[:, None], ("exchange",), 1,
        )  # fmt: skip


def _fixed(effect: Effect, kind: Kind, fitted: str, course: FloatArray, scale: float) -> Suspect:
    """A change that is all or nothing; one number of its shape is fitted, of a scale, or its amplitude."""
    hypothesis = Hypothesis(effect.site, effect.driver, kind, effect, (fitted,), ({},), {}, {fitted: scale})
    return Suspect(hypothesis, course[:, None], (), 1)


def _lagged(v: FloatArray, tau: float, dt: float) -> FloatArray:
    """First-order lag of what is held over each interval, as it acts at the end of the interval on average."""
    a = float(np.exp(-dt / tau))
    found: FloatArray = lfilter([1 - a], [1, -a], v, zi=[a * v[0]])[0]
    return found
