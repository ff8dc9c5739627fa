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

What is looked for may wander as well. Then a second course stands at its site, and is told as an effect: the model has
it as a `polyline` in time through its knots, whose values are those of its u.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.greybox.effects import Effect
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

    def effect(self, knots: FloatArray) -> Effect:
        """The effect that draws it: a polyline through its knots (k,)."""
        settings = {"knots": tuple(map(float, knots))}
        return Effect(self.site, "time", "polyline", settings=settings, mode="offset" if self.offset else "factor")

    def effect_in(self, model: Model) -> Effect:
        """The effect of a model that draws it."""
        return next(e for e in model.effects if e.site == self.site and e.driver == "time" and e.form == "polyline")

    def parameters_in(self, model: Model) -> tuple[str, ...]:
        """Parameters of a model that hold its values at the knots."""
        effect = self.effect_in(model)
        return tuple(effect.parameter(c.name) for c in effect.terms)

    def values_in(self, model: Model) -> FloatArray:
        """Its values (k,) at the knots, as a model has them."""
        where = model.indices("parameters", self.parameters_in(model))
        return np.array([model.parameters[i].value for i in where])

    def root(self, model: Model) -> FloatArray:
        """Std L (k, k), with L L' its correlation at the knots of the effect that draws it in a model."""
        knots: FloatArray = np.asarray(self.effect_in(model).settings["knots"], dtype=float)
        return self.std * root_of_covariance(knots, self.time)


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
    told
        A course that is told as an effect; its responses come before all others.
    """

    course: Course | None
    constants: float
    responses: FloatArray
    sites: tuple[str, ...] = ()
    told: Course | None = None

    def first(self, model: Model) -> FloatArray:
        """u0 (r,), whose constants and told course a model has already; zero for the course of the feed."""
        first = np.zeros(self.responses.shape[2])
        if self.told is not None:
            values = self.told.values_in(model)
            first[: len(values)] = np.linalg.solve(self.told.root(model), values)
        if self.sites:
            first[-len(self.sites) :] = logarithms_of_factors(model, self.sites) / self.constants
        return first

    def outputs(self, u: FloatArray, model: Model) -> FloatArray:
        """What it adds to the measured outputs (N, m) of a model, for u (r,)."""
        return self.change(u - self.first(model))

    def at_its_values(self, u: FloatArray, model: Model) -> Model:
        """The model with the constants of u (r,), and with its told course."""
        if self.told is not None:
            names = self.told.parameters_in(model)
            values = self.told.root(model) @ u[: len(names)]
            model = model.with_parameters(dict(zip(names, map(float, values), strict=True)))
        if not self.sites:
            return model
        factors = np.exp(self.constants * u[-len(self.sites) :])
        return rescaled(model, dict(zip(self.sites, map(float, factors), strict=True)))

    def holding(self, sites: Collection[str]) -> Background:
        """The background that leaves the constants at some of its sites as they are: nothing responds to their u."""
        held = np.zeros(self.responses.shape[2], dtype=bool)
        held[len(held) - len(self.sites) :] = [site in sites for site in self.sites]
        return replace(self, responses=np.where(held, 0.0, self.responses))

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
