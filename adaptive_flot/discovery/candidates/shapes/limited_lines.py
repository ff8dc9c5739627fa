"""A straight line between two values of a signal and level beyond, started from a fitted curve over that signal.

A limit, a threshold or a dead zone has a kink, and a smooth curve through eight knots leaves some per cent of it. Where
the error was many times the noise, these per cent are enough for a further effect that is not there. So the best curves
are fitted as such a line too. Its kinks start where the line is nearest to the curve, in least squares over the values
that the record has seen, with exp(curve) where the change is a factor::

    min over a, b, k1, k2 of sum_i (curve(x_i) - a - b min(max(x_i, k1), k2))^2
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.spline import drawn
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.forms.static import BOTH_SIDES, ONE_ABOVE, ONE_BELOW
from adaptive_flot.greybox.model import FloatArray

LIMITED = {"offset": "limited_line", "factor": "limited_factor"}
"""The form, by what a change at the site is: an amount, or a factor."""
POINTS, KINKS = 80, 19
"""Values of the signal at which a line is compared with the curve, and places of a kink between its ends."""
COVERED = (0.002, 0.998)
"""Quantiles of the signal that are the knots: beyond them it is level on either side."""
LEAST_FACTOR = 0.1
"""Least factor from which a fit starts."""
NEAR = 0.3
"""A line whose squared error is above this share of the curve's variance does not draw it."""


def limited_lines(score: Score, curve: Effect, seen: FloatArray) -> list[Score]:
    """Scores with the lines that start from a fitted curve over a signal, one for each side that may be level.

    Parameters
    ----------
    score
        The candidate's score.
    curve
        The fitted curve, with its coefficients.
    seen
        Values of its driver (N,) in the record.
    """
    low, high = (float(q) for q in np.quantile(seen, COVERED))
    if not high > low:
        return []
    at: FloatArray = np.quantile(seen, np.linspace(*COVERED, POINTS))
    values = drawn(curve, at)
    places = np.linspace(low, high, KINKS + 2).tolist()
    ends = {
        ONE_BELOW: [(k, places[-1]) for k in places[1:-1]],
        ONE_ABOVE: [(places[0], k) for k in places[1:-1]],
        BOTH_SIDES: list(combinations(places[1:-1], 2)),
    }
    is_factor = (curve.mode or score.candidate.site.mode) == "factor"
    form = LIMITED["factor" if is_factor else "offset"]
    values = np.exp(values) if is_factor else values
    variance = float(np.var(values))
    scores = []
    for sides, tried in ends.items():
        left, (begins, stops) = min((_left(at, values, pair)[0], pair) for pair in tried)
        if left > NEAR * variance:
            continue
        _, level, slope = _left(at, values, (begins, stops))
        kinks = {"begins": begins, "ends": stops}
        first, last = level + slope * begins, level + slope * stops
        if is_factor:
            first, last = (float(np.log(max(v, LEAST_FACTOR))) for v in (first, last))
        start = {"amplitude": (first + last) / 2, "slope": last - first}
        settings: dict[str, float | tuple[float, ...]] = {"knots": (low, high), "sides": float(sides)}
        effect = Effect(curve.site, curve.driver, form, settings=settings, mode=curve.mode)
        names = effect.names(CoefficientRole.THRESHOLD)
        shape = tuple((name, kinks[name]) for name in names)
        variant = Variant(effect, (), ("amplitude", "slope"), shape)
        scores.append(replace(score, variant=variant, start=start | dict(shape)))
    return scores


def _left(at: FloatArray, values: FloatArray, ends: tuple[float, float]) -> tuple[float, float, float]:
    """Mean squared error of the best line between two ends, its level at 0 and its slope."""
    x = np.clip(at, *ends)
    centred = x - x.mean()
    slope = float(centred @ values / max(float(centred @ centred), 1e-300))
    level = float(values.mean() - slope * x.mean())
    return float(np.mean((values - level - slope * x) ** 2)), level, slope
