"""The curve of a fitted effect over its driver, with the band that the covariance of the fit gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from adaptive_flot.discovery.assessment.telling_rows import edges
from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole, number
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper

POINTS = 161
MOST_EDGES = 400
"""Edges of a curve that are drawn as edges: more are closer than a picture shows."""
EDGE_SHARE = 1e-6
"""Width of an edge of a switch, as a share of what the driver covers."""
EDGE_WIDTHS = 6
"""Widths of an edge around it, over which it is drawn."""
BAND = 1.96
FREE = 3.0
"""Where the curve at its middle is so many times as uncertain as its shape, only the shape is shown."""
ASIDE = 1e-3
"""Step over which the slope at the middle is taken, as a share of what the driver covers."""


@dataclass(frozen=True)
class EffectCurve:
    """What an effect does to the value at its site, over its driver.

    Attributes
    ----------
    effect
        The fitted effect.
    driver_unit, unit
        Units of the driver and of the change; "-" for a factor.
    relative
        Whether `change` is a factor on the value, else what is added to it.
    driver
        Values of the driver (K,), over what the record covers.
    change, low, high
        The change and its 95 % band (K,), linearised in the coefficients.
    seen
        Values of the driver on the rows from the first that any split has.
    falling
        The change (K,) while the driver falls, of a switch with two thresholds; `change` is then that while it rises.
    is_on
        Whether such a switch is on, on the same rows as `seen`.
    anchor
        Value of the driver at which the change is shown as none, since the record can not tell a constant one from the
        adapted parameters; None where it can.
    bend_only
        Whether its slope at `anchor` is shown as none too: a fitted stiffness takes up the straight part of a spring.
    """

    effect: Effect
    driver_unit: str
    unit: str
    relative: bool
    driver: FloatArray
    change: FloatArray
    low: FloatArray
    high: FloatArray
    seen: FloatArray
    anchor: float | None = None
    bend_only: bool = False
    falling: FloatArray | None = None
    is_on: BoolArray | None = None


def effect_curves(problem: Problem, fit: Fit, count: int) -> tuple[EffectCurve, ...]:
    """Curves of the last `count` effects of a fit.

    Those without a driver (constant, lag, dead time) have none, and neither has what depends on the value at the site
    itself: a part that leaks or is stuck is told by its level. A hidden store has none, because what it does depends on
    what was before. A switch with two thresholds has two branches.
    """
    effects = fit.model.fitted_effects()
    wanted = [e for e in effects[len(effects) - count :] if _has_curve(fit, e)]
    if not wanted:
        return ()
    series, values = _series(problem, fit)
    first = max(problem.first_row - 1, 0)  # the series begin at the second row
    curves = (_curve(fit, e, series[e.driver][first:], values[e.site]) for e in wanted)
    return tuple(
        replace(c, is_on=series[f"{c.effect.label}.on"][first:] > 0.5) if c.effect.family.memory else c for c in curves
    )


def _has_curve(fit: Fit, effect: Effect) -> bool:
    remembers = any(q.name.startswith(f"{effect.label}.") for q in fit.model.states)
    without_driver = effect.driver in ("constant", "lag", "delay", "saturation", "own_value")
    without_driver |= effect.driver == "time" and effect.family.direct is not None  # what it adds follows what is asked
    return not without_driver and (effect.family.memory is not None or not remembers)


def _series(problem: Problem, fit: Fit) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Series of every driver along the fitted free run, and the median value at every site."""
    model, record, p = fit.model, problem.record, parameters_of(fit)
    start = float(record.time[0])
    run = Stepper(model, record.dt).simulate(fit.initial_state, record.inputs[1:], p, start)
    table = {q.name: record.inputs[1:, j] for j, q in enumerate(model.inputs)}
    table |= {q.name: run.states[:, j] for j, q in enumerate(model.states)}
    table |= {q.name: run.signals[:, j] for j, q in enumerate(model.signals)}
    table["time"] = run.time
    rows = slice(None, None, max(1, len(run.time) // 200))
    z = [np.array(model.ode(t, x, u, p)[3]) for t, x, u in _thinned(run.time, run.states, record.inputs[1:], rows)]
    at = [
        np.array(model.site_values(t, x, u, p, zk)).ravel()
        for (t, x, u), zk in zip(_thinned(run.time, run.states, record.inputs[1:], rows), z, strict=True)
    ]
    return table, dict(zip((s.name for s in model.sites), np.median(at, axis=0).tolist(), strict=True))


def _thinned(
    time: FloatArray, states: FloatArray, inputs: FloatArray, rows: slice
) -> list[tuple[float, FloatArray, FloatArray]]:
    return list(zip(time[rows].tolist(), states[rows], inputs[rows], strict=True))


def _curve(fit: Fit, effect: Effect, seen: FloatArray, value: float) -> EffectCurve:
    model = fit.model
    site = next(s for s in model.sites if s.name == effect.site)
    units = {q.name: q.unit for q in (*model.inputs, *model.states, *model.signals)} | {"time": "s"}
    relative = effect.family.static is not None and (effect.mode or site.mode) == "factor"
    x = _places(effect, float(np.min(seen)), float(np.max(seen)))
    g, slope = _law(effect, value)
    names = [effect.parameter(c.name) for c in effect.terms]
    c = np.array([effect.coefficients[t.name] for t in effect.terms])
    sees, back = _branches(effect, x)
    middle = np.array([float(g(v, c)) for v in sees])
    gradient = np.array([np.array(slope(v, c)).ravel() for v in sees])
    covariance, anchor, bend_only = _covariance(fit, names), None, False
    if effect.family.static is not None:
        typical, step = float(np.median(seen)), ASIDE * float(np.ptp(x))
        near, _ = _branches(effect, typical + step * np.array([0.0, -1.0, 1.0]))
        values, slopes = (
            np.array([float(g(v, c)) for v in near]),
            np.array([np.array(slope(v, c)).ravel() for v in near]),
        )
        shape, its_gradient = middle - values[0], gradient - slopes[0]
        line, its_line = (np.multiply.outer((x - typical) / (2 * step), d[2] - d[1]) for d in (values, slopes))
        stds = _spread(its_gradient - its_line, covariance), _spread(its_line, covariance)
        bend_only = back is None and not relative and _bend_only(shape - line, stds[0], line, stds[1])
        if bend_only:
            anchor, middle, gradient = typical, shape - line, its_gradient - its_line
        elif _spread(slopes[:1], covariance)[0] > FREE * np.max(_spread(its_gradient, covariance)):
            anchor, middle, gradient = typical, shape, its_gradient
    std = _spread(gradient, covariance)
    shown = np.exp if relative else np.asarray
    low, change, high = (shown(middle + k * BAND * std) for k in (-1, 0, 1))
    unit = "-" if relative else (site.unit or "")
    falling = None if back is None else shown(np.array([float(g(v, c)) for v in back]))
    driver_unit = units.get(effect.driver, "")
    return EffectCurve(effect, driver_unit, unit, relative, x, change, low, high, seen, anchor, bend_only, falling)


def _bend_only(bend: FloatArray, bend_std: FloatArray, line: FloatArray, line_std: FloatArray) -> bool:
    """Whether the record tells how a curve (K,) bends, and not its straight part: that may be none, unlike the bend."""
    unknown = np.max(line_std) > FREE * np.max(bend_std) and np.max(np.abs(line)) < BAND * np.max(line_std)
    return bool(unknown and np.max(np.abs(bend) - BAND * bend_std) > 0)


def _places(effect: Effect, low: float, high: float) -> FloatArray:
    """Values of the driver (K,) at which an effect is drawn: even ones, and close ones where it has edges."""
    even = np.linspace(low, high, POINTS)
    if effect.family.memory:
        width, at = EDGE_SHARE * (high - low), tuple(effect.values(CoefficientRole.THRESHOLD))
    elif effect.family.passes:
        width, at = float(number(effect.full_settings, "width")), edges(effect)
    elif effect.values(CoefficientRole.PHASE):
        width, at = float(number(effect.full_settings, "width")), _edges_of_periods(effect, low, high)
    else:
        return even
    if not at:
        return even
    around = width * np.linspace(-EDGE_WIDTHS, EDGE_WIDTHS, 2 * EDGE_WIDTHS + 1)
    close = np.concatenate([t + around for t in at])
    return np.unique(np.concatenate([even, close[(close > low) & (close < high)]]))


def _edges_of_periods(effect: Effect, low: float, high: float) -> tuple[float, ...]:
    """When what is switched in every period is switched, from `low` to `high` [s]; none where that is too often."""
    onset, duration, period = (effect.coefficients[name] for name in ("onset", "duration", "period"))
    begins = onset + period * np.arange(np.floor((low - onset) / period), np.ceil((high - onset) / period) + 1)
    return tuple(np.concatenate([begins, begins + duration])) if 2 * len(begins) <= MOST_EDGES else ()


def _branches(effect: Effect, x: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """What the law of an effect sees at values of its driver (K,): as it rises, and as it falls where that differs."""
    if not effect.family.memory:
        return x, None
    on_above, off_below = (effect.coefficients[n] for n in effect.names(CoefficientRole.THRESHOLD))
    return (x > on_above).astype(float), (x > off_below).astype(float)


def _spread(gradient: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard deviation (K,) of values with the derivatives G (K, q) by coefficients of covariance C (q, q).

    sqrt(diag(G C G')): the delta method (Rao, *Linear Statistical Inference*, 2nd ed., 6a.2).
    """
    deviations: FloatArray = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", gradient, covariance, gradient), 0))
    return deviations


def _covariance(fit: Fit, names: Sequence[str]) -> FloatArray:
    """Covariance of some parameters; zero where one was held."""
    covariance = np.zeros((len(names), len(names)))
    free = [i for i, n in enumerate(names) if n in fit.names]
    where = [fit.names.index(names[i]) for i in free]
    covariance[np.ix_(free, free)] = fit.covariance[np.ix_(where, where)]
    return covariance


def _law(effect: Effect, value: float) -> tuple[ca.Function, ca.Function]:
    """The change g(driver, coefficients) of an effect without states at a typical value of its site, and its slope."""
    x, c = ca.SX.sym("x"), ca.SX.sym("c", len(effect.terms))
    coefficients = {t.name: c[i] for i, t in enumerate(effect.terms)}
    family, settings = effect.family, effect.full_settings
    if family.static is not None:
        g = ca.SX(family.static(x, coefficients, settings))
    else:
        assert family.direct is not None  # a form has one law or the other
        g = family.direct(_Stateless(), ca.SX(value), x, coefficients, settings) - value
    return ca.Function("g", [x, c], [g]), ca.Function("slope", [x, c], [ca.gradient(g, c)])


class _Stateless:
    """Scope of a direct law that owns no state."""

    def own_state(self, name: str) -> ca.SX:
        raise NotImplementedError(f"a form with the state {name!r} has no curve")

    def own_derivative(self, name: str, value: ca.SX, decay: ca.SX | None = None) -> None:
        raise NotImplementedError(f"a form with the state {name!r} has no curve")
