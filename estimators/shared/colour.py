"""How far the errors of a fit are from white noise, and what that says about its covariance.

The covariance of least squares counts every sample as news. Errors that stay on one side for long are fewer news than
samples: the covariance is too small by the long-run variance of the errors over their variance::

    colour = 1 + 2 sum over lags l of (1 - l / (L + 1)) r_l         with the autocorrelation r_l and L = N / 10

Source: Newey & West, *Econometrica* 55 (1987) 703. Errors beyond three robust standard deviations are clipped, since
outliers would hide a correlation.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import median_abs_deviation

from adaptive_flot.greybox.model import FloatArray

WINDOW = 10
"""One lag for so many samples."""
CLIP = 3.0
"""Robust standard deviations beyond which an error counts as one of that size."""


def colour(errors: FloatArray) -> FloatArray:
    """Long-run variance of each column of errors (N, m), NaN where missing, over its variance (m,).

    What is missing is closed up. NaN where nothing was measured.
    """
    return np.array([_colour(column[np.isfinite(column)]) for column in errors.T])


def _colour(errors: FloatArray) -> float:
    if not errors.size:
        return float("nan")
    most = CLIP * float(median_abs_deviation(errors, scale="normal"))
    e = np.clip(errors, -most, most) if most > 0 else errors
    lags = np.arange(1, max(1, len(e) // WINDOW) + 1)
    products = np.array([e[k:] @ e[:-k] for k in lags if k < len(e)])
    weights = 1 - lags[: len(products)] / (len(lags) + 1)
    power = float(e @ e)
    return 1.0 if power == 0 else float(max(0.0, 1 + 2 * weights @ products / power))
