"""Knots of a fitted curve that it does not need: the true cause draws the simplest profile, others must mimic its run.

Backward elimination on the grid of knots that was fitted, by what the loss of each adds to minus two log-likelihood to
second order. With the fitted values v at all knots, their covariance C, and the spline B through the knots kept::

    added = min over b of (v - B b)' C^-1 (v - B b)

This is Wald's statistic of the hypothesis that v = B b: *Trans. Am. Math. Soc.* 54 (1943) 426. Knots of a regression
spline as a choice of variables: Smith (1982), NASA CR-166034.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from adaptive_flot.discovery.candidates.catalogue import FINE_TIME_KNOTS, TIME_KNOTS
from adaptive_flot.discovery.candidates.spline import knots_of, through
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

MOST_KNOTS = 28
"""Knots of the freest curve in time."""
ON_GRID = 1e-3
"""A knot is one of even knots when it is no further from there than this share of their distance."""


@dataclass(frozen=True)
class Trimmed:
    """A curve without the knots that it does not need: variant, values to start from, and what its fit should gain."""

    variant: Variant
    start: dict[str, float]
    gain: float


def trimmed(fit: Fit, effect: Effect, price: float) -> Trimmed | None:
    """The last effect of a fit, a curve, with as few knots as the record asks for; None where it needs all.

    Knots around an event stay: they are few, and tell an event from a drift.

    Parameters
    ----------
    fit
        The fit, with the covariance of the curve's values.
    effect
        The curve, with its coefficients.
    price
        What a knot must bring in minus two log-likelihood to stay.
    """
    if not effect.family.is_curve:
        return None
    knots = knots_of(effect)
    if effect.driver == "time" and not is_even(knots):
        return None
    where = [fit.names.index(effect.parameter(f"value_{k + 1}")) for k in range(len(knots))]
    values: FloatArray = np.array(fit.values[where], dtype=float)
    information: FloatArray = np.array(
        np.linalg.pinv(fit.covariance[np.ix_(where, where)], hermitian=True), dtype=float
    )
    if not (np.isfinite(information).all() and np.isfinite(values).all()):
        return None
    kept, lost = list(knots), 0.0
    drawn: FloatArray = np.array(values)
    while len(kept) > 2:
        tries = [_without(knots, values, information, kept[:j] + kept[j + 1 :]) for j in range(1, len(kept) - 1)]
        j = int(np.argmin([loss for loss, _ in tries]))
        if tries[j][0] - lost > price:
            break
        lost, drawn = tries[j]
        kept.pop(j + 1)
    if len(kept) == len(knots):
        return None
    return Trimmed(*through(effect, kept, drawn), price * (len(knots) - len(kept)) - lost)


def _without(
    knots: list[float], values: FloatArray, information: FloatArray, kept: list[float]
) -> tuple[float, FloatArray]:
    """How much worse the best curve through fewer knots is, and its values there."""
    # the spline of the model, from SciPy: the model's own takes a hundred times as long to set up
    basis = CubicSpline(kept, np.eye(len(kept)), bc_type="natural")(knots)
    system = basis.T @ information @ basis
    fitted: FloatArray = np.asarray(np.linalg.lstsq(system, basis.T @ information @ values, rcond=None)[0], dtype=float)
    off = values - basis @ fitted
    return float(off @ information @ off), fitted


def is_even(knots: list[float]) -> bool:
    """Whether knots are evenly spread, or what trimming has left of the even knots of a time profile."""
    places = (np.array(knots) - knots[0]) / (knots[-1] - knots[0])
    for count in (len(knots), TIME_KNOTS, FINE_TIME_KNOTS, MOST_KNOTS):
        steps = places * (count - 1)
        if np.max(np.abs(steps - np.round(steps))) < ON_GRID:
            return True
    return False
