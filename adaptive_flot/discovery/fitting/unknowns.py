"""What a fit is free to move: parameters, combinations of the initial state that the record can tell, the background.

The background is that of the problem, where it has one (see `record.background`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state

DIRECTION_PRIOR = 5.0
"""Standard deviation of the weak prior of a direction of the initial state, in units of the states' scales."""
PRIOR_SCALES = 20.0
"""Standard deviation of the weak prior of an effect's coefficients, in units of their scale."""
LAGGED_SCALES = 0.1
"""How far a direction moves the states of a new effect, in their scales: their usual value is about one."""


class Unknowns:
    """Unknowns z: q free parameters over their scale, r free directions of the initial state, the background's u (k,).

    Attributes
    ----------
    names
        Free parameters (q,), the adapted ones first.
    shaped
        Whether some of them shape an effect (an onset, a time constant): derivatives by these change from step to step.
    lower, upper, centre
        Range and start of z (q + r + k,).
    prior, prior_centre
        Standard deviation and centre of the weak prior of z (q + r + k,).
    directions
        Free combinations of the initial state (nx, r).
    """

    def __init__(
        self,
        problem: Problem,
        model: Model,
        free: tuple[str, ...],
        start: Mapping[str, float],
        like: Fit | None,
        bounds: Mapping[str, tuple[float, float]],
    ) -> None:
        self.problem, self.model = problem, model
        self.names = (*problem.adapted, *(n for n in free if n not in problem.adapted))
        self.where = model.indices("parameters", self.names)
        parameters = [model.parameters[i] for i in self.where]
        if like is not None:
            start = {**{p.name: p.value for p in like.model.parameters}, **start}
        self.base = np.array([start.get(p.name, p.value) for p in model.parameters])
        self.x0 = self._first_state(like)
        self.first_guess = self._first_guess(like)
        self.q = len(self.names)
        sized = coefficient_scales(model, problem.site_sizes, problem.record.dt)
        self.scale = np.array([sized.get(p.name, p.scale) for p in parameters])
        low = [max(p.lower, bounds.get(p.name, (-np.inf, np.inf))[0]) for p in parameters]
        high = [min(p.upper, bounds.get(p.name, (-np.inf, np.inf))[1]) for p in parameters]
        shapes = {e.parameter(c.name) for e in model.effects for c in e.terms if c.is_shape}
        self.shaped = any(p.name in shapes for p in parameters)
        unbound = [i < len(problem.adapted) or p.name in shapes for i, p in enumerate(parameters)]
        self._range = np.array(low) / self.scale, np.array(high) / self.scale
        self._prior = np.where(unbound, np.inf, PRIOR_SCALES)
        self._prior_centre = np.array([p.value for p in parameters]) / self.scale
        self._background = self._first_background(like)
        self.turn(self._first_directions(like))

    def turn(self, directions: FloatArray) -> None:
        """Make these directions (nx, r) of the initial state the free ones."""
        r, k = directions.shape[1], len(self._background)
        self.directions = directions
        self.lower = np.concatenate([self._range[0], np.full(r + k, -np.inf)])
        self.upper = np.concatenate([self._range[1], np.full(r + k, np.inf)])
        self.prior = np.concatenate([self._prior, np.full(r, DIRECTION_PRIOR), np.ones(k)])
        expected: FloatArray = np.zeros(r)
        if len(self.first_guess) and r:
            expected[:] = np.linalg.lstsq(directions, self.first_guess - self.x0, rcond=None)[0]
        self.prior_centre = np.concatenate([self._prior_centre, expected, np.zeros(k)])
        start = np.concatenate([self.base[self.where] / self.scale, np.zeros(r), self._background])
        self.centre = np.clip(start, self.lower, self.upper)

    def _first_state(self, like: Fit | None) -> FloatArray:
        record, n = self.problem.record, len(self.model.states)
        if like is not None:
            return self._settled_filters(dict(zip(like.model.names("states"), like.initial_state, strict=True)))
        if record.initial_state is not None and n == len(record.initial_state):
            return record.initial_state
        guess = self.model.first_guess
        if not self.model.starts_steady:
            return guess
        try:
            return steady_state(self.model, record.inputs[0], self.base).state
        except RangeError:
            return guess

    def _first_guess(self, like: Fit | None) -> FloatArray:
        """Where the initial state (nx,) is expected: as in a fit, and where it starts of states that this has beside.

        Empty where it is expected where it starts, in each fit anew.
        """
        if like is None or not len(like.first_guess):
            return np.zeros(0)
        known = dict(zip(like.model.names("states"), like.first_guess, strict=True))
        return np.array([known.get(name, x) for name, x in zip(self.model.names("states"), self.x0, strict=True)])

    def _first_background(self, like: Fit | None) -> FloatArray:
        """The background u (k,) of a fit, or none; empty where the problem has none."""
        background = self.problem.background
        if background is None:
            return np.zeros(0)
        first = background.first(self.model)
        return like.background if like is not None and len(like.background) == len(first) else first

    def _first_directions(self, like: Fit | None) -> FloatArray:
        """Free directions of the initial state (nx, r): those of a fit, in the states that the model has in common.

        And two for the states that it has beside: a record may start while a slow sensor is still on its way.
        """
        if like is None:
            return np.zeros((len(self.x0), 0))
        rows = dict(zip(like.model.names("states"), like.directions, strict=True))
        nothing = np.zeros(like.directions.shape[1])
        states = self.model.states
        known = np.array([rows.get(s.name, nothing) for s in states])
        return np.hstack([known, _along([0.0 if s.name in rows else s.scale for s in states])])

    def _settled_filters(self, known: Mapping[str, float]) -> FloatArray:
        """Initial state with the states of new effects where they are at rest beside the known ones, by name."""
        record, names = self.problem.record, self.model.names("states")
        x = np.array([known.get(name, 1.0) for name in names])
        new = [i for i, name in enumerate(names) if name not in known]
        if not new:
            return x
        arguments = record.time[0], x, record.inputs[0], self.base
        slope = np.array(self.model.ode.factory("slope", ["t", "x", "u", "p"], ["jac:xdot:x"])(*arguments))
        rate = np.array(self.model.ode(*arguments)[0]).ravel()
        if not (np.isfinite(slope).all() and np.isfinite(rate).all()):
            return x  # the run from here will not be finite either, and is told so
        x[new] -= np.linalg.lstsq(slope[np.ix_(new, new)], rate[new], rcond=None)[0]
        return x

    def unpack(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters (np,) and initial state (nx,), kept inside the physical range of each state."""
        p = self.base.copy()
        p[self.where] = z[: self.q] * self.scale
        x0 = self.x0 + self.directions @ z[self.q : self.first_of_background]
        lower = np.array([s.lower for s in self.model.states])
        upper = np.array([s.upper for s in self.model.states])
        return p, cast(FloatArray, np.clip(x0, lower, upper))

    @property
    def first_of_background(self) -> int:
        """Where the background begins in z."""
        return self.q + len(self.directions.T)

    def initial_gradient(self) -> FloatArray:
        """Derivative of the initial state by all of z but the background (nx, q + r)."""
        return np.hstack([np.zeros((len(self.x0), self.q)), self.directions])


def coefficient_scales(model: Model, sizes: Mapping[str, float], dt: float) -> dict[str, float]:
    """Scale of each time, and of each coefficient in the unit of its site, by full name: an ordinary change there.

    A form knows neither its site nor its unit: a tenth of a kelvin may be much, a tenth of a watt is nothing. Its times
    are those of a process with a row a second; of another they count in sampling intervals (`dt` [s]).
    """
    modes = {site.name: site.mode for site in model.sites}
    scales = {}
    for effect in model.effects:
        offset, size = (effect.mode or modes[effect.site]) == "offset", sizes.get(effect.site, 0.0)
        for c in effect.terms:
            if size > 0 and (c.unit == "value" or (c.unit == "g" and offset)):
                scales[effect.parameter(c.name)] = size
            elif c.unit == "s":
                scales[effect.parameter(c.name)] = c.scale * dt
    return scales


def _along(scales: Sequence[float]) -> FloatArray:
    """Directions (nx, r <= 2) of the states whose scale is not zero, a chain of lags: all as one, and evenly spread."""
    new = np.flatnonzero(scales)
    directions = np.zeros((len(scales), min(len(new), 2)))
    for k in range(directions.shape[1]):
        directions[new, k] = LAGGED_SCALES * np.array(scales)[new] * np.linspace(1, -1, len(new)) ** k
    return directions
