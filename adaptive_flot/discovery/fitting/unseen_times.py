"""Times of events that no fitted row has seen: an end after all of them, and a change within a held-out stretch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole, number
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator

EDGES = 2.0
"""Rows, and widths of its edges, before the last fitted row from which an event counts as there in that."""
LEAST = 1.0
"""Drop of the squares of all rows, in variances of the noise, from which a time within a held-out stretch is moved."""
TRIED = 16
"""Times of a stretch that are tried before the best of them is refined."""


def with_unseen_ends(fitter: Fitter, fit: Fit) -> Fit:
    """The fit, its events that are there in the last fitted row held to the end of the record, and no time of an end.

    An analyser that stayed 12 % low was told to be right again from the first row on that nobody had fitted.
    """
    time, dt = fitter.problem.record.time, fitter.problem.record.dt
    last = float(time[np.flatnonzero(fitter.rows)[-1]])
    held = {}
    for effect in fit.model.fitted_effects():
        begins, lasts = (effect.names(role) for role in (CoefficientRole.ONSET, CoefficientRole.DURATION))
        if not effect.family.passes or len(begins) != len(lasts):
            continue
        settings = effect.full_settings
        width = number(settings, "width") if "width" in settings else 0.0
        for begin, long in zip(begins, lasts, strict=True):
            onset, end = effect.coefficients[begin], effect.coefficients[begin] + effect.coefficients[long]
            if last - EDGES * (dt + width) <= end < time[-1] and effect.parameter(long) in fit.names:
                held[effect.parameter(long)] = float(time[-1] - onset + EDGES * (dt + width))
    if not held:
        return fit
    names = tuple(name for name in fit.names if name not in held)
    return fitter.fit(fit.model.with_parameters(held), names, held, fit, rounds=2) or fit


def with_unseen_changes(fitter: Fitter, fit: Fit) -> tuple[Fit, tuple[float, ...]]:
    """The fit, its changes that fell into held-out stretches moved to where these have them, and their times [s].

    Fitted rows on both sides of a stretch only say that something begins or ends between them. A meter that jumped in
    the middle of a stretch was told at its end, and what was wrong until then took the name back. Nothing but the time
    is read from rows that were held out.
    """
    problem, moved = fitter.problem, list[float]()
    for k in range(len(_changes(fit, problem.record.dt))):
        change = _changes(fit, problem.record.dt)[k]  # a beginning that has moved bounds its end
        stretch = _unseen(problem.record.time, fitter.rows, change)
        if stretch is None or problem.time_is_up:
            continue
        best, at = _moved(fitter, fit, change, stretch)
        if _squares(problem, fit, best.predicted) < _squares(problem, fit, fit.predicted) - LEAST:
            fit = best
            moved.append(at)
    return fit, tuple(moved)


@dataclass(frozen=True)
class _Change:
    """A time [s] that a fit has come to, its range, and by how much free parameters change with it."""

    told: float
    shares: Mapping[str, float]
    least: float = -np.inf
    most: float = np.inf


def _changes(fit: Fit, dt: float) -> list[_Change]:
    """Beginnings and ends of the events of a fit: the other one of an event stays, a row of `dt` [s] away at least."""
    found = []
    for effect in fit.model.fitted_effects():
        begins, lasts = (effect.names(role) for role in (CoefficientRole.ONSET, CoefficientRole.DURATION))
        paired = lasts if len(begins) == len(lasts) else ("",) * len(begins)
        for begin, long in zip(begins, paired, strict=True):
            onset, end = effect.coefficients[begin], np.inf
            lasting = _free(fit, effect, long)
            if lasting:
                end = onset + effect.coefficients[long]
            if _free(fit, effect, begin):
                shares = {_free(fit, effect, begin): 1.0, **({lasting: -1.0} if lasting else {})}
                found.append(_Change(onset, shares, most=end - dt))
            if lasting:
                found.append(_Change(end, {lasting: 1.0}, least=onset + dt))
    return found


def _free(fit: Fit, effect: Effect, coefficient: str) -> str:
    """Full name of a coefficient that is fitted; empty where it is not."""
    name = effect.parameter(coefficient) if coefficient else ""
    return name if name in fit.names else ""


def _unseen(time: FloatArray, fitted: BoolArray, change: _Change) -> tuple[float, float] | None:
    """Times [s] between which a change may be: those of the fitted rows about it; None where none lies between."""
    seen = np.flatnonzero(fitted)
    after = int(np.searchsorted(time[seen], change.told))
    if not 0 < after < len(seen) or seen[after] - seen[after - 1] <= EDGES:
        return None
    first, last = max(float(time[seen[after - 1]]), change.least), min(float(time[seen[after]]), change.most)
    return (first, last) if first < last else None


def _moved(fitter: Fitter, fit: Fit, change: _Change, stretch: tuple[float, float]) -> tuple[Fit, float]:
    """The fit with a change at the time of a stretch that leaves the least squares of all rows, and that time [s].

    Its variance is, with the curvature of the squares S over d = two rows or less, at most that of a uniform law over
    the stretch::

        2 d^2 / (S(t + d) - 2 S(t) + S(t - d))
    """
    problem = fitter.problem
    record, columns = problem.record, list(problem.columns)
    where = {name: fit.names.index(name) for name in change.shares}

    def free_run(values: FloatArray) -> FloatArray:
        model = fit.model.with_parameters(dict(zip(fit.names, map(float, values), strict=True)))
        run = RecordSimulator(model, record.dt)
        return run.outputs(record, fit.initial_state, model.parameter_values)[:, columns]

    beside = fit.predicted - free_run(fit.values)  # what a background adds

    def values_at(t: float) -> FloatArray:
        values = fit.values.copy()
        for name, share in change.shares.items():
            values[where[name]] += share * (t - change.told)
        return values

    def left(t: float) -> float:
        return _squares(problem, fit, free_run(values_at(t)) + beside)

    times = np.linspace(*stretch, TRIED)
    losses = [left(float(t)) for t in times]
    k = int(np.argmin(losses))
    bounds = float(times[max(k - 1, 0)]), float(times[min(k + 1, TRIED - 1)])
    found = minimize_scalar(lambda t: left(float(t)), bounds=bounds, options={"xatol": record.dt / 4})
    best = float(found.x) if found.fun < losses[k] else float(times[k])
    d = min(2 * record.dt, best - stretch[0], stretch[1] - best)
    curvature = left(best + d) - 2 * left(best) + left(best - d)
    widest = (stretch[1] - stretch[0]) ** 2 / 12
    variance = min(2 * d**2 / curvature, widest) if d > 0 and curvature > 0 else widest
    covariance = fit.covariance.copy()
    for i in where.values():
        covariance[i, :] = covariance[:, i] = 0.0
        covariance[i, i] = variance
    values = values_at(best)
    predicted = free_run(values) + beside
    innovations = fit.noise.whiten((problem.measured - predicted) / problem.weights)
    model = fit.model.with_parameters(dict(zip(fit.names, map(float, values), strict=True)))
    moved = replace(
        fit, model=model, values=values, covariance=covariance, predicted=predicted, innovations=innovations
    )
    return moved, best


def _squares(problem: Problem, fit: Fit, predicted: FloatArray) -> float:
    """Squares of what a run (N, m) leaves of all rows, in variances of the noise of a fit; infinite where it runs off.

    They are not whitened: a noise model with a memory takes up an error that lasts.
    """
    size = problem.weights * fit.noise.stationary_std()
    with np.errstate(over="ignore", invalid="ignore"):
        total = float(np.nansum((((problem.measured - predicted) / size) ** 2)[problem.rows()]))
    return total if np.isfinite(predicted).all() else np.inf
