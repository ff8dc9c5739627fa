"""The background: what is always a little wrong with a model, beside whatever is looked for.

A feed that nobody measures wanders. Its course w(t) at a site is a Gaussian process with the covariance of a
first-order autoregression::

    cov(w(s), w(t)) = std^2 exp(-|s - t| / time)

Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (4.15) (Ornstein-Uhlenbeck). It is drawn by
straight lines between knots, w = B L u with u ~ N(0, I) and L L' its covariance at the knots.

And the constants of the process are known to some per cent only: the logarithm of the value at each site is off by
``std u`` with u ~ N(0, 1), one u for each site.

Both are linear in u - u0 along a fitted run, where the model has the constants of u0 already (see `greybox.rescaled`).
All u are estimated beside whatever else is unknown, and integrated out in the likelihood (see `fitting.fit`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.rescaled import logarithms_of_factors, rescaled


@dataclass(frozen=True)
class Course:
    """How a feed wanders.

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
    """

    site: str
    std: float
    time: float
    offset: bool


@dataclass(frozen=True)
class Background:
    """What is always a little wrong with a model.

    Attributes
    ----------
    course
        The feed that wanders; None without.
    constants
        Standard deviation of the logarithm of each constant; zero where they are as the model says.
    responses
        Linear responses (N, m, r) of the measured outputs to each component of u: those of the course, then the
        constants.
    sites
        Sites of the constants, in the order of their responses.
    """

    course: Course | None
    constants: float
    responses: FloatArray
    sites: tuple[str, ...] = ()

    def first(self, model: Model) -> FloatArray:
        """u0 (r,), whose constants a model has already; zero for the course."""
        first = np.zeros(self.responses.shape[2])
        if self.sites:
            first[-len(self.sites) :] = logarithms_of_factors(model, self.sites) / self.constants
        return first

    def outputs(self, u: FloatArray, model: Model) -> FloatArray:
        """What it adds to the measured outputs (N, m) of a model, for u (r,)."""
        return self.change(u - self.first(model))

    def at_constants(self, u: FloatArray, model: Model) -> Model:
        """The model with the constants of u (r,)."""
        if not self.sites:
            return model
        factors = np.exp(self.constants * u[-len(self.sites) :])
        return rescaled(model, dict(zip(self.sites, map(float, factors), strict=True)))

    def change(self, moved: FloatArray) -> FloatArray:
        """What a change of u (r,) does to the measured outputs (N, m)."""
        there: FloatArray = self.responses @ moved
        return there


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
