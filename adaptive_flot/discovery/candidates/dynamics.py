"""Sensors that respond late, actuators that follow late, stick, reach a limit or leak: what each does to the value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.record.screening import LEAST_RANGE
from adaptive_flot.discovery.record.slip_jump import asked_from_outside, jumping
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.scope import Site

LAGS = (1.5, 5.0, 15.0, 45.0, 120.0)
"""Time constants that are tried, in sampling intervals."""
LONGEST_LAG = 0.1
"""Longest of them, as a share of the record."""
SECOND_LAG = 0.5
"""The second of two lags in a row starts at this share of the first."""
FOLLOWS = 1.0
"""Time constant of a valve that has come loose, or of a relay, in sampling intervals."""
DELAYS = (3.0, 10.0, 30.0, 60.0, 120.0, 240.0)
"""Dead times that are tried, in sampling intervals."""
LONGEST_DELAY = 0.2
"""Longest dead time that is tried, as a share of the record."""
BOUNDS: Mapping[str, tuple[str, str, tuple[float, ...], np.ufunc]] = {
    "saturation": ("saturation", "limit", (0.6, 0.75, 0.9), np.minimum),
    "own_value": ("leak", "level", (0.1, 0.25, 0.4), np.maximum),
}
"""Drivers of an actuator that reaches a limit, or does not close: form, its coefficient, the quantiles of what is asked
at which it is scored, and what is left of the distance to the bound where it acts. Where a quantile is the end of the
range itself, the share is one of the range."""
LIMIT_WIDTH = 0.01
"""Rounding of the limit, as a share of the range of what is asked."""
BANDS = (0.3, 1.0)
"""And as sticking in bands of so many standard deviations of what is asked of it."""


def late(site: Site, driver: str, responses: Responses) -> Iterator[Variant]:
    """Variants of what responds late: lags or dead times of several lengths, for an actuator a wide dead band."""
    if not _moves(responses.site_values[site.name]):
        return
    if driver == "delay":
        yield from _delayed(site, responses)
        return
    v, scale = _asked(site, responses)
    dt, time = responses.problem.record.dt, responses.problem.record.time
    for constant in (n * dt for n in LAGS if n * dt <= LONGEST_LAG * (time[-1] - time[0])):
        once = _first_order(v, float(np.exp(-dt / constant)))
        effect = Effect(site.name, "lag", "lag", settings={"scale": scale})
        start = (("time_constant", constant),)
        yield Variant(effect, (TimeProfile(site.name, once - v, True),), ("amplitude",), start)
        second = SECOND_LAG * constant
        twice = _first_order(once, float(np.exp(-dt / second)))
        effect = Effect(site.name, "lag", "lags", settings={"scale": scale})
        yield Variant(
            effect, (TimeProfile(site.name, twice - v, True),), ("amplitude",), (*start, ("time_constant_2", second))
        )
    if site.role == "actuator":
        yield from _sticking(site, responses)


def _moves(v: FloatArray) -> bool:
    return float(np.ptp(v)) > LEAST_RANGE * float(np.median(np.abs(v)))


def _asked(site: Site, responses: Responses) -> tuple[FloatArray, float]:
    """What is asked of an actuator, or comes to a sensor (N,), and its typical size."""
    return responses.site_values[site.name], responses.usual(site.name) or 1.0


def _delayed(site: Site, responses: Responses) -> Iterator[Variant]:
    v, scale = _asked(site, responses)
    effect = Effect(site.name, "delay", "delay", settings={"scale": scale})
    dt, time = responses.problem.record.dt, responses.problem.record.time
    for dead_time in (n * dt for n in DELAYS if n * dt <= LONGEST_DELAY * (time[-1] - time[0])):
        rows = round(dead_time / dt)
        delayed = np.concatenate([np.full(rows, v[0]), v[:-rows]])
        yield Variant(effect, (TimeProfile(site.name, delayed - v, True),), ("amplitude",), (("dead_time", dead_time),))


def bounded(site: Site, driver: str, responses: Responses) -> Iterator[Variant]:
    """What is asked of an actuator, cut at a limit ("saturation"), or not below a floor: it leaks ("own_value")."""
    v = responses.site_values[site.name]
    if not _moves(v):
        return
    form, coefficient, shares, beyond = BOUNDS[driver]
    low, span = float(v.min()), float(np.ptp(v))
    width = LIMIT_WIDTH * span
    effect = Effect(site.name, driver, form, settings={"width": width})
    end = low + span if driver == "saturation" else low
    for share in shares:
        bound = float(np.quantile(v, share))
        if abs(bound - end) <= width:  # a valve that is shut half of the time: a share of the range is as good
            bound = low + share * span
        change = beyond(bound - v, 0.0)
        if change.any():
            profile = TimeProfile(site.name, change, True)
            if responses.is_hidden(site.name, change):
                told = replace(effect, coefficients={"amplitude": 1.0, coefficient: bound})
                profile = replace(profile, response=responses.change_by(told))
            yield Variant(effect, (profile,), ("amplitude",), ((coefficient, bound),))


def _sticking(site: Site, responses: Responses) -> Iterator[Variant]:
    """An actuator that follows only when the demand leaves a band around where it stands."""
    v, scale = _asked(site, responses)
    settings = {"scale": scale, "follow_s": FOLLOWS * responses.problem.record.dt}
    for share in BANDS:
        band = share * float(np.std(v))
        if band > 0:
            profile = TimeProfile(site.name, dragged(v, band) - v, True)
            effect = Effect(site.name, "lag", "stiction", settings=settings)
            yield Variant(effect, (profile,), ("amplitude",), (("band", band),))
    if site.name not in asked_from_outside(responses.fit.model):
        return
    settings = {"scale": scale, "interval_s": responses.problem.record.dt}
    for jump in jumping(v):
        profile, chosen = TimeProfile(site.name, jump.position - v, True), {"band": jump.band, "rest": jump.rest}
        effect = Effect(site.name, "lag", "slip_jump", chosen, settings)
        yield Variant(effect, (profile,), ("amplitude",), tuple(chosen.items()))


def dragged(v: FloatArray, band: float) -> FloatArray:
    """Position (N,) of what is dragged along behind a demand (N,) that moves freely inside a band around it."""
    position = np.empty_like(v)
    at = v[0]
    for k, demand in enumerate(v):
        at = min(max(at, demand - band), demand + band)
        position[k] = at
    return position


def _first_order(v: FloatArray, keep: float) -> FloatArray:
    filtered: FloatArray = lfilter([1 - keep], [1, -keep], v, zi=[keep * v[0]])[0]
    return filtered
