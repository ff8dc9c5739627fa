"""A feed that wanders: a disturbance that nobody measures, as a random course beside whatever is looked for.

The course w(t) at a site is a Gaussian process with the covariance of a first-order autoregression::

    cov(w(s), w(t)) = std^2 exp(-|s - t| / time)

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (4.15) (Ornstein-Uhlenbeck). It is drawn by
straight lines between knots, w = B L u with u ~ N(0, I) and L L' its covariance at the knots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class Wander:
    """An unmeasured disturbance that wanders.

    Attributes
    ----------
    site
        Where it acts.
    std
        Standard deviation: of the logarithm of the value at the site, or of the value itself where `offset`.
    time
        Correlation time [s].
    offset
        Whether it adds to the value at the site, or else multiplies it.
    responses
        Linear responses (N, m, r) of the measured outputs to each component of u.
    """

    site: str
    std: float
    time: float
    offset: bool
    responses: FloatArray

    def outputs(self, u: FloatArray) -> FloatArray:
        """What a course does to the measured outputs (N, m)."""
        moved: FloatArray = self.responses @ u
        return moved


def knots_of_course(time: FloatArray, most: int, least_rows: int) -> FloatArray:
    """Even knots (k,) over the times of a record (N,), at least so many rows apart."""
    count = int(min(most, max(len(time) // least_rows, 2)))
    return np.linspace(time[0], time[-1], count)


def lines_between(time: FloatArray, knots: FloatArray) -> FloatArray:
    """Basis B (N, k) of straight lines between knots: 1 at the own knot, 0 at all others."""
    return np.column_stack([np.interp(time, knots, own) for own in np.eye(len(knots))])


def root_of_covariance(knots: FloatArray, time: float) -> FloatArray:
    """L (k, k) with L L' the correlation of the course at its knots."""
    return np.asarray(np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / time) + 1e-10 * np.eye(len(knots))))
