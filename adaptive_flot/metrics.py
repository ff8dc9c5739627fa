"""Figures of merit."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray


def fit(truth: FloatArray, estimate: FloatArray) -> float:
    """Fit in percent, `100 (1 - |truth - estimate| / |truth|)` in the 2-norm over time (paper, Section V).

    NaN where the estimate is not finite everywhere.

    >>> fit(np.array([1.0, 1.0]), np.array([1.0, 1.0]))
    100.0
    """
    return float(100.0 * (1.0 - np.linalg.norm(truth - estimate) / np.linalg.norm(truth)))


def rmse(error: FloatArray) -> float:
    """Root mean square of the finite entries; NaN if there are none."""
    finite = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def normalised_error_squared(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised estimation error squared e' P^-1 e of each row (N,), for errors (N, q) and covariances (N, q, q).

    An estimator that knows its own error has chi-squared values of q degrees of freedom. NaN where the covariance is
    singular or not finite.

    Source: Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), 5.4.2.

    >>> normalised_error_squared(np.array([[3.0, 4.0]]), np.diag([9.0, 4.0])[None]).tolist()
    [5.0]
    """
    found = np.full(len(error), np.nan)
    usable = np.flatnonzero(np.isfinite(error).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    usable = usable[np.linalg.matrix_rank(covariance[usable], hermitian=True) == error.shape[1]]
    whitened = np.linalg.solve(covariance[usable], error[usable, :, None])[:, :, 0]
    found[usable] = np.einsum("ij,ij->i", error[usable], whitened)
    return found
