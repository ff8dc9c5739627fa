"""What each family would change at a site along a record: courses of its value, for a regression."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from adaptive_flot.discovery.hypotheses.families import Hypothesis, offset_limits, span_limits
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site

LEVELS = np.linspace(0.0, 1.0, 11)
"""Levels at which a part may be stuck, leak or end, as shares of the range of its value."""
LAGS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Time constants that are tried, in sampling intervals."""
STORES = (10.0, 30.0, 100.0, 300.0)
"""Time constants of a hidden store, likewise."""
LONGEST = 0.1
"""Longest time constant of a lag, as a share of the record; of a store, three times that."""
ENDS = (0.05, 0.95)
"""Quantiles of a driver between which a dependence is drawn as a straight line."""
LEAST_MOVE = 1e-3
"""A driver that moves by a smaller share of its size can not be told from a constant."""
ROUNDING = 1e-3
"""Rounding of corners, as a share of the range of the value."""


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
    """Yield everything but switches and periodic changes that sites allow by their role.

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


def _at_site(
    model: Model, site: Site, v: FloatArray, drivers: Mapping[str, FloatArray], dt: float
) -> Iterator[Suspect]:
    low, high = float(v.min()), float(v.max())
    spread, size = high - low, float(np.median(np.abs(v)))
    moves = spread > LEAST_MOVE * max(size, 1e-300)
    name = site.name
    one = np.ones((len(v), 1))
    if site.role in ("actuator", "sensor") and moves:
        for level in low + LEVELS * spread:
            yield _fixed(
                name,
                "own_value",
                "stuck",
                "stuck",
                {"amplitude": 1.0, "level": float(level)},
                {},
                ("level",),
                level - v,
                1,
            )
        if site.role == "actuator":
            width = {"width": ROUNDING * spread}
            for level in low + LEVELS[1:] * spread:
                there = {"amplitude": 1.0, "level": float(level)}
                yield _fixed(name, "own_value", "leaks", "leak", there, width, ("level",), np.maximum(v, level) - v, 1)
            for level in low + LEVELS[1:-1] * spread:
                there = {"amplitude": 1.0, "limit": float(level)}
                yield _fixed(
                    name, "saturation", "range", "saturation", there, width, ("limit",), np.minimum(v, level) - v, 1
                )
        for intervals in LAGS:
            tau = intervals * dt
            if 1.0 <= tau <= LONGEST * len(v) * dt:
                yield _fixed(
                    name, "lag", "lag", "lag", {"amplitude": 1.0, "time_constant": tau}, {"scale": size or 1.0},
                    ("time_constant",), _lagged(v, tau, dt) - v, 1,
                )  # fmt: skip
    if site.role == "sensor" and moves:
        if low < 0 < high:
            yield _fixed(
                name,
                "own_value",
                "sign",
                "rectified",
                {"amplitude": 1.0},
                {"width": ROUNDING * spread},
                ("amplitude",),
                np.abs(v) - v,
                1,
            )
        middle = float(np.median(v))
        effect = Effect(name, "own_value", "span", settings={"middle": middle})
        yield Suspect(
            Hypothesis(name, "own_value", "span", effect, ("offset", "slope"), ({},), span_limits(spread)),
            np.column_stack([one[:, 0], v - middle]), ("offset", "slope"),
        )  # fmt: skip
    if site.role in ("sensor", "actuator") or site.mode == "offset":
        effect = Effect(name, "constant", "shift", mode="offset")
        limits = offset_limits(spread or size)
        yield Suspect(
            Hypothesis(name, "constant", "offset", effect, ("amplitude",), ({},), limits), one, ("amplitude",)
        )
    if site.role != "sensor" and size > 0 and site.mode == "factor":
        effect = Effect(name, "constant", "shift", mode="factor")
        yield Suspect(Hypothesis(name, "constant", "gain", effect, ("amplitude",), ({},)), v[:, None], ("amplitude",))
    if site.role in ("process", "flow", "feed"):
        by = v if site.mode == "factor" else np.ones_like(v)
        for driver, d in drivers.items():
            if driver in _known_at(model, site):
                yield from _depends(site, driver, d, by)
        for state in model.states:
            if site.role == "flow" and state.name in drivers and "." not in state.name:
                yield from _stores(site, state.name, drivers[state.name], v, dt)


def _known_at(model: Model, site: Site) -> set[str]:
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


def _stores(site: Site, state: str, x: FloatArray, v: FloatArray, dt: float) -> Iterator[Suspect]:
    for intervals in STORES:
        tau = intervals * dt
        if tau > 3 * LONGEST * len(v) * dt:
            break
        effect = Effect(site.name, state, "store", {"exchange": 0.0, "time_constant": tau})
        h = _lagged(x, tau, dt)
        yield Suspect(
            Hypothesis(site.name, state, "store", effect, ("exchange", "time_constant"), ({},)),
            (x - h)[:, None], ("exchange",), 1,
        )  # fmt: skip


def _fixed(
    site: str, driver: str, kind: str, form: str, coefficients: Mapping[str, float], settings: Mapping[str, float],
    free: tuple[str, ...], course: FloatArray, shapes: int,
) -> Suspect:  # fmt: skip
    effect = Effect(site, driver, form, coefficients, settings)
    return Suspect(Hypothesis(site, driver, kind, effect, free, ({},)), course[:, None], (), shapes)  # type: ignore[arg-type]


def _lagged(v: FloatArray, tau: float, dt: float) -> FloatArray:
    """First-order lag of what is held over each interval, as it acts at the end of the interval on average."""
    a = float(np.exp(-dt / tau))
    found: FloatArray = lfilter([1 - a], [1, -a], v, zi=[a * v[0]])[0]
    return found
