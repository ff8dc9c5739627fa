"""Whether a further effect brings enough: evidence, and a good part of the error, over all or in one output.

A wrong constant may put one output twenty standard deviations off. Beside it a sensor that is three off is next to
nothing over all outputs, though it is all that is wrong with its own. So each output counts by itself, too.
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.assessment.reduction import column_means, squared_errors
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import without_spikes
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.greybox.model import FloatArray

SUBSTANCE = 0.1
"""A further effect must remove at least this share of the excess error of the base model."""
MOST_OF_AN_OUTPUT = 0.5
"""Or more than this share of that of one output,"""
VISIBLE = 1.0
"""where it removes more than so many variances of its noise: an error as large as the noise."""


def better(problem: Problem, base: Fit, before: Alternative | None, latest: Round) -> bool:
    """Whether the best alternative of a round brings evidence and, as a further effect, substance.

    Evidence: its BIC is lower by the round's threshold. Substance: it removes more than SUBSTANCE of the excess error
    (see `excess`) of the model as it is, or most of that of one output.
    """
    if not latest.alternatives:
        return False
    best, reference = latest.alternatives[0], before.fit if before else base
    if not best.fit.bic <= reference.bic - latest.threshold:
        return False
    return before is None or _has_substance(problem, base, reference, best.fit)


def _has_substance(problem: Problem, base: Fit, before: Fit, after: Fit) -> bool:
    if excess(problem, before, after) > SUBSTANCE * excess(problem, base, after):
        return True
    removed, wrong = excess_by_output(problem, before, after), _means(problem, after, before) - 1.0
    return bool(np.any((removed > VISIBLE) & (removed > MOST_OF_AN_OUTPUT * wrong)))


def repairs(problem: Problem, base: Fit, before: Fit, after: Fit, share: float) -> bool:
    """Whether a fit removes a share of what the base model left of one output that it leaves visibly wrong."""
    removed, wrong = excess_by_output(problem, before, after), excess_by_output(problem, base, after)
    return bool(np.any((wrong > VISIBLE) & (removed > share * wrong)))


def excess(problem: Problem, fit: Fit, better_fit: Fit) -> float:
    """Mean squared error of the rows fitted in units of the better fit's noise, less that of the better fit.

    ::

        mean of (r / s)^2 - mean of (r_better / s)^2

    with residuals r, and the standard deviation s of the better fit's noise.
    """
    size, rows = problem.weights * better_fit.noise.stationary_std(), problem.rows("estimate")
    old, new = (np.nanmean(squared_errors(problem, f, size, rows)) for f in (fit, better_fit))
    return float(old - new)


def excess_by_output(problem: Problem, fit: Fit, better_fit: Fit) -> FloatArray:
    """The same of each output by itself (m,)."""
    return _means(problem, better_fit, fit) - _means(problem, better_fit, better_fit)


def worth_extending(problem: Problem, base: Fit, best: Alternative, left: tuple[float, float]) -> bool:
    """Whether what is left is a substantial share of what there was, over all or in one output.

    Over all by first-order gains on one noise. In one output where its error is still more than `VISIBLE` above the
    noise, and most of what it was.
    """
    gain, threshold = left
    if gain < threshold:
        return False
    size = problem.weights * best.fit.noise.std
    rows = problem.rows("estimate")
    removed = np.nansum(((base.residual(problem) / size) ** 2 - (best.fit.residual(problem) / size) ** 2)[rows])
    if gain > SUBSTANCE / 2 * float(removed):
        return True
    return bool(still_wrong(problem, best.fit))


def still_wrong(problem: Problem, best: Fit) -> list[int]:
    """Places among the measured outputs of those that `best` leaves wrong: VISIBLE above the noise."""
    return np.flatnonzero(_means(problem, best, best) - 1.0 > VISIBLE).tolist()


def _means(problem: Problem, scale: Fit, fit: Fit) -> FloatArray:
    """Mean squared error (m,) of a fit on the rows fitted, in variances of the noise of `scale`; without outliers."""
    size, rows = scale.noise.stationary_std(), problem.rows("estimate")
    errors = without_spikes(fit.residual(problem) / problem.weights)[rows] / size
    return column_means(errors**2)
