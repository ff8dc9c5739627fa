"""Outliers among the errors of a fit, told from errors of the model.

Noise with outliers is that of Huber, *Annals of Mathematical Statistics* 35 (1964) 73, in standard deviations::

    e ~ (1 - share) N(0, 1) + share N(0, SCALE^2)

An error of the model lasts for some samples, an outlier stands alone. So an error counts by its distance from the
medians of the samples before and after it: the smaller distance, and none where it lies between both. The standard
deviation is that of the differences from sample to sample, by their median absolute deviation, over the root of 2. The
share is the most likely one (expectation maximisation: Dempster, Laird & Rubin, *Journal of the Royal Statistical
Society B* 39 (1977) 1).
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.stats import median_abs_deviation

from adaptive_flot.greybox.model import FloatArray

SIDE = 5
"""Samples before and after of which a median is taken: what lasts for more than half of them is no outlier."""
FEWEST = 30
"""Samples below which nothing is said: the spread of fewer is not known well."""
FOUND = 6.0
"""Standard deviations beyond which there are outliers at all: Gaussian noise never comes there."""
SCALE, FIRST_SHARE, MOST = 20.0, 0.01, 0.2
"""Size of outliers in standard deviations, share to begin with, and share from which they are noise of another kind."""
ROUNDS = 10


def belief(errors: FloatArray) -> FloatArray:
    """Probability that each of some errors (N, m) is no outlier; exactly 1 where a column has none, and where missing.

    A column with outliers in more than a fifth of its samples, or with fewer than 30 samples, is taken as it is.
    """
    found = np.ones_like(errors)
    for column, of in zip(errors.T, found.T, strict=True):
        here = np.isfinite(column)
        of[here] = _belief(column[here])
    return found


def _belief(e: FloatArray) -> FloatArray:
    usual = np.ones(len(e))
    if len(e) < FEWEST:
        return usual
    std = float(median_abs_deviation(np.diff(e), scale="normal")) / np.sqrt(2)
    alone = _alone(e)
    if not std > 0 or alone.max() <= FOUND * std:
        return usual
    squared, share = (alone / std) ** 2, FIRST_SHARE
    for _ in range(ROUNDS):
        odds = share / (1 - share) / SCALE * np.exp(np.minimum(squared * (1 - SCALE**-2) / 2, 700.0))
        usual = 1 / (1 + odds)
        share = float(np.clip(1 - usual.mean(), 1 / len(e), 0.5))
    return usual if share <= MOST else np.ones(len(e))


def _alone(e: FloatArray) -> FloatArray:
    """Distance of each (N,) from the nearer of the medians before and after; at both ends there is only one."""
    medians = np.median(sliding_window_view(e, SIDE), axis=1)
    before, after = e.copy(), e.copy()
    before[SIDE:], after[:-SIDE] = e[SIDE:] - medians[:-1], e[:-SIDE] - medians[1:]
    before[:SIDE], after[-SIDE:] = after[:SIDE], before[-SIDE:]
    nearer: FloatArray = np.minimum(np.abs(before), np.abs(after))
    return np.where(before * after > 0, nearer, 0.0)
