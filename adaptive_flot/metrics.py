"""Figures of merit."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray


def fit(truth: FloatArray, estimate: FloatArray) -> float:
    """Fit in percent, 100 (1 - |truth - estimate| / |truth|) in the 2-norm over time (paper, Section V).

    NaN where the estimate is not finite everywhere.

    >>> fit(np.array([1.0, 1.0]), np.array([1.0, 1.0]))
    100.0
    """
    return float(100.0 * (1.0 - np.linalg.norm(truth - estimate) / np.linalg.norm(truth)))


def rmse(error: FloatArray) -> float:
    """Root mean square of the finite entries; NaN if there are none."""
    finite = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")
