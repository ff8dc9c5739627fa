"""By how much an error is smaller on some rows, with an interval from blocks of neighbouring rows."""

from __future__ import annotations

import numpy as np
from scipy.stats import bootstrap

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray

SHORTEST_BLOCK = 4
MANY_BLOCKS = 8
"""A split too short for so many blocks gets shorter ones."""
DRAWS = 500


def reduction(old: FloatArray, new: FloatArray, block: int, of: int = 1) -> tuple[float, tuple[float, float]]:
    """Reduction of the root mean square error with its interval.

    With the sums O_b and N_b over blocks of neighbouring rows::

        reduction = 1 - sqrt(sum_b N_b / sum_b O_b)

    Pairs (O_b, N_b) are drawn with replacement, and the interval is between two quantiles of the draws: the percentile
    bootstrap (Efron, *Ann. Statist.* 7 (1979) 1) of blocks that do not overlap (Carlstein, *Ann. Statist.* 14 (1986)
    1171; those of Kunsch, *Ann. Statist.* 17 (1989) 1217, do).

    Parameters
    ----------
    old, new
        Squared errors (N,), NaN where missing.
    block
        Rows of a block; fewer in a short split.
    of
        How many such intervals are to hold together with 95 %: each is one of 1 - 0.05 / of, from DRAWS draws for each.

    Returns
    -------
    tuple
        The reduction and its interval; zero with an infinite one where there are fewer than four blocks.
    """
    ok = np.isfinite(old) & np.isfinite(new)
    length = int(np.clip(ok.sum() // MANY_BLOCKS, SHORTEST_BLOCK, block))
    count = int(ok.sum()) // length
    if count < 4 or not old[ok].sum() > 0:
        return 0.0, (float("-inf"), float("inf"))
    a, b = (s[ok][: count * length].reshape(count, -1).sum(axis=1) for s in (old, new))

    def statistic(x: FloatArray, y: FloatArray, axis: int = -1) -> FloatArray:
        value: FloatArray = 1 - np.sqrt(np.sum(y, axis=axis) / np.maximum(np.sum(x, axis=axis), 1e-300))
        return value

    interval = bootstrap(
        (a, b),
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=DRAWS * of,
        confidence_level=1 - 0.05 / of,
        method="percentile",
        rng=0,
    ).confidence_interval
    return float(statistic(a, b)), (float(interval.low), float(interval.high))


def squared_errors(problem: Problem, fit: Fit, size: FloatArray, rows: BoolArray) -> FloatArray:
    """Squared errors of a fit on some rows (rows, m), in units of a size (m,) or (N, m)."""
    squares: FloatArray = ((fit.residual(problem) / size) ** 2)[rows]
    return squares


def column_means(values: FloatArray) -> FloatArray:
    """Mean of each column (m,) of values (n, m), missing ones left out; zero of a column without any."""
    seen = np.isfinite(values)
    means: FloatArray = np.where(seen, values, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return means
