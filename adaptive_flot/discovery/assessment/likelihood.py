"""What a difference of likelihood between two fits says: how much evidence it is, and how certain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.assessment.reduction import MANY_BLOCKS, SHORTEST_BLOCK, column_means, squared_errors
from adaptive_flot.discovery.assessment.telling_rows import pulse_rows, touched_rows
from adaptive_flot.discovery.fitting.fit import Fit, row_losses
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray

LEAST_EVIDENCE = 10.0
"""Drop of a criterion that counts: "very strong" evidence (Kass & Raftery, *J. Am. Statist. Assoc.* 90 (1995) 773)."""
FEWEST_BLOCKS = 4
"""Blocks without which a deviation can not be told."""
COMPARISON_BLOCK_ROWS = 60
"""Rows of a block in which two fits are compared: what both lack is slower than the noise."""


def loglik_difference_sds(problem: Problem, best: Fit, others: Sequence[Fit]) -> tuple[float, ...]:
    """Standard deviation of the difference between each fit's minus two log-likelihood and that of the best.

    With the difference D_b over block b of B (see `row_losses`)::

        sd = sqrt(B) * standard deviation of D_b

    The likelihood ratio test of models that are not nested: Vuong, *Econometrica* 57 (1989) 307, eq. (4.2), with blocks
    of rows instead of rows, as these depend on one another; the fits stay as they are (Kishino & Hasegawa, *J. Mol.
    Evol.* 29 (1989) 170). A fit that is worse by less than `SURE` of these would be the better one in some records like
    this. Zero of a record with fewer than MANY_BLOCKS blocks. The rows that a pulse touches have
    blocks of their own, where they are enough: it is over in one or two of the others.
    """
    rows = problem.rows("estimate")
    if rows.sum() < MANY_BLOCKS * SHORTEST_BLOCK:
        return tuple(0.0 for _ in others)
    return tuple(_difference_sd(problem, best, fit) for fit in others)


def _difference_sd(problem: Problem, best: Fit, fit: Fit) -> float:
    return _fitted_sd(problem, best, fit, touched_rows(problem, (best, fit)))


def _fitted_sd(problem: Problem, best: Fit, fit: Fit, touched: BoolArray) -> float:
    """Deviation on the fitted rows: of those that a pulse touches, where they are enough, and of all others."""
    rows = problem.rows("estimate")
    difference = np.zeros(len(rows))
    difference[rows] = row_losses(problem, fit, rows) - row_losses(problem, best, rows)
    if (rows & touched).sum() < MANY_BLOCKS * SHORTEST_BLOCK:
        return _sd_of_sum(difference[rows])
    return float(np.hypot(_sd_of_sum(difference[rows & touched]), _sd_of_sum(difference[rows & ~touched])))


def _sd_of_sum(difference: FloatArray) -> float:
    """Standard deviation of the sum of differences (n,) of neighbouring rows, by blocks."""
    length = int(np.clip(len(difference) // MANY_BLOCKS, SHORTEST_BLOCK, COMPARISON_BLOCK_ROWS))
    count = len(difference) // length
    if count < FEWEST_BLOCKS:  # too few to say: as if all of it were chance
        return float(np.abs(difference).sum())
    blocks = difference[: count * length].reshape(count, length).sum(axis=1)
    return float(np.std(blocks, ddof=1) * np.sqrt(count))


def difference_with_confirm_rows(problem: Problem, best: Fit, fit: Fit) -> tuple[float, float]:
    """How much worse minus two log-likelihood of a fit is on the confirm rows as well, and the deviation of it all.

    A pulse has few rows to estimate it, and a wrong one can be bent to draw these. So the rows that fitted neither are
    asked too: those that tell anything (see `telling_rows`). The deviation is that of the sum of both, each by blocks
    as in `loglik_difference_sds`: rows that were fitted differ by less than those that were not.
    """
    touched = touched_rows(problem, (best, fit))
    asked = pulse_rows(problem, (best, fit), "confirm", ("estimate",), touched)
    unseen = row_losses(problem, fit, asked) - row_losses(problem, best, asked)
    return float(unseen.sum()), float(np.hypot(_fitted_sd(problem, best, fit, touched), _sd_of_sum(unseen)))


def rows_per_effective_sample(problem: Problem, before: Fit, after: Fit) -> float:
    """Rows for each effective sample of a fit's innovations, averaged by what it gained in each output on another fit.

    With the autocorrelation time t_j of the innovations of output j (see `correlation_times`) and the drop g_j of its
    mean squared error::

        t = sum_j g_j t_j / sum_j g_j

    A disturbance that is slower than any noise of a sensor is not whitened away, and would be counted in every row.
    """
    rows = problem.rows("estimate")
    size = problem.weights * after.noise.stationary_std()
    old, new = (column_means(squared_errors(problem, fit, size, rows)) for fit in (before, after))
    gained = np.maximum(old - new, 0.0)
    if not gained.sum() > 0:
        return 1.0
    innovations = np.clip(np.where(rows[:, None], after.innovations, np.nan), -problem.clip, problem.clip)
    return float(gained @ correlation_times(innovations) / gained.sum())


def worth_its_freedom(problem: Problem, before: Fit, after: Fit) -> bool:
    """Whether what a freer form gains pays for its further coefficients, evidence counted once an effective sample.

    By the Bayesian information criterion of N / t samples, with t of `rows_per_effective_sample` and q coefficients
    more: (drop of minus two log-likelihood) / t > q log(N / t). Schwarz, *Ann. Statist.* 6 (1978) 461.

    Where something else is still missing, neighbouring rows err alike, and a criterion that counts them all would
    take any freedom it can get.
    """
    rows_each = rows_per_effective_sample(problem, before, after)
    further = len(after.names) - len(before.names)
    samples = max(problem.count(problem.rows("estimate")) / rows_each, 2.0)
    return (before.loss - after.loss) / rows_each > further * float(np.log(samples))
