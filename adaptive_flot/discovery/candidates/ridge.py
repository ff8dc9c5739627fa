"""Ridge regression that holds for a record without any noise, too."""

from __future__ import annotations

from typing import cast

import numpy as np

from adaptive_flot.greybox.model import FloatArray

LOST = 0.01
"""Rounding of X'X, against the identity that is added to it, beyond which the sum is not formed."""


def ridge(X: FloatArray, y: FloatArray) -> FloatArray:
    """Coefficients b (r,) of y (n,) on X (n, r), which are few standard deviations: b ~ N(0, I).

    ::

        b = (X'X + I)^-1 X'y

    Hoerl & Kennard, *Technometrics* 12 (1970) 55. An output without noise has responses of 10^9 units of the smallest
    noise that is believed. The identity is lost in rounding beside their squares, and the sum may be singular. Then
    this solves the least squares of the stacked rows [X, y] and [I, 0], in which nothing is squared.
    """
    gram = X.T @ X
    if np.trace(gram) * np.finfo(float).eps < LOST:
        return cast(FloatArray, np.linalg.solve(gram + np.eye(len(gram)), X.T @ y))
    r = X.shape[1]
    stacked = np.linalg.lstsq(np.vstack([X, np.eye(r)]), np.concatenate([y, np.zeros(r)]), rcond=None)
    return cast(FloatArray, stacked[0])
