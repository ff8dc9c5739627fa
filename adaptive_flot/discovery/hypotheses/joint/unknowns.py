"""The unknowns of a joint fit as one vector: coefficients, constants, the initial state of each record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.greybox.model import FloatArray, Model

STATE_PRIOR = 1.0
"""Standard deviation of the prior of the initial state, in the scales of the states."""
DIFFERENCE = 1e-4
"""Step of differences, in scales of the unknowns."""
EDGE = 1e-9


class JointUnknowns:
    """Coefficients (q,) in their scales, constants (c,) in units of their prior, initial states (nx,) in scales.

    Parameters
    ----------
    model
        The model with its effects.
    constants
        Constants that are fitted, and what is known of them.
    coefficients
        Names of the coefficients that are fitted.
    initial
        First guess of the initial state of each record (nx,).

    Attributes
    ----------
    q, c, nx
        How many of each there are.
    scale
        Scales of the coefficients (q,): an unknown of 1 is so much.
    lower, upper
        Bounds (q + c + nx records,): of coefficients, and of constants of which each has an unknown of its own.
    """

    def __init__(
        self, model: Model, constants: Constants, coefficients: Sequence[str], initial: Sequence[FloatArray]
    ) -> None:
        self.model, self.constants, self.coefficients, self.initial = model, constants, coefficients, tuple(initial)
        self._own = model.indices("parameters", coefficients)
        self._shared = model.indices("parameters", constants.names)
        self.scale = np.array([model.parameters[i].scale or 1.0 for i in self._own])
        self._state_scale = np.array([s.scale for s in model.states])
        self._ends = np.array([[p.lower for p in model.parameters], [p.upper for p in model.parameters]])
        self.q, self.c, self.nx = len(self._own), len(self._shared), len(model.states)
        scales = np.array([model.parameters[i].scale or 1.0 for i in self._shared])
        # how many scales the constants move with each of their unknowns; a difference moves them by a small part of one
        self._reach = np.maximum(1.0, np.abs(constants.root / scales[:, None]).max(axis=0, initial=0.0))
        self.lower, self.upper = self._bounds()

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        q, c = self.q, self.c
        ends = np.full((2, q + c + self.nx * len(self.initial)), [[-np.inf], [np.inf]])
        root = np.diag(self.constants.root)
        ends[:, :q] = self._ends[:, self._own] / self.scale
        if np.array_equal(self.constants.root, np.diag(root)) and (root > 0).all():
            ends[:, q : q + c] = [self.constants.distances(end) / root for end in self._ends[:, self._shared]]
        return ends[0], ends[1]

    def prior(self, z: FloatArray) -> FloatArray:
        """Residuals of the priors of constants and initial states."""
        residuals: FloatArray = z[self.q :] * self.weights()
        return residuals

    def weights(self) -> FloatArray:
        """One over the standard deviation of each of these."""
        return np.concatenate([np.ones(self.c), np.full(self.nx * len(self.initial), 1 / STATE_PRIOR)])

    def inside(self, z: FloatArray) -> FloatArray:
        """The unknowns with their coefficients inside their bounds."""
        moved = z.copy()
        moved[: self.q] = np.clip(z[: self.q], self.lower[: self.q], self.upper[: self.q])
        return moved

    def off_bounds(self, z: FloatArray) -> FloatArray:
        """The unknowns moved off their bounds, where a search could not start."""
        low = np.where(np.isfinite(self.lower), self.lower + EDGE * (1 + np.abs(np.nan_to_num(self.lower))), -np.inf)
        high = np.where(np.isfinite(self.upper), self.upper - EDGE * (1 + np.abs(np.nan_to_num(self.upper))), np.inf)
        moved: FloatArray = np.minimum(np.maximum(z, low), high)
        return moved

    def start(self, values: Mapping[str, float] | None = None) -> FloatArray:
        """Unknowns with these coefficients, the model's own else, and everything else at its prior."""
        known = values or {}
        own = [known.get(n, self.model.parameters[i].value) for n, i in zip(self.coefficients, self._own, strict=True)]
        return np.concatenate([np.array(own) / self.scale, np.zeros(self.c + self.nx * len(self.initial))])

    def difference(self, i: int, z: FloatArray) -> FloatArray:
        """A small step of one unknown, to the side on which bounds leave it more room."""
        step = np.zeros(len(z))
        step[i] = DIFFERENCE / (self._reach[i - self.q] if self.q <= i < self.q + self.c else 1.0)
        return -step if self._beyond(z + step) > self._beyond(z - step) else step

    def parameters(self, z: FloatArray) -> FloatArray:
        """All parameters of the model (np,), inside their bounds."""
        p = self.model.parameter_values
        p[self._own], p[self._shared] = z[: self.q] * self.scale, self._constants(z)
        inside: FloatArray = np.clip(p, *self._ends)
        return inside

    def _constants(self, z: FloatArray) -> FloatArray:
        return self.constants.at(z[self.q : self.q + self.c])

    def _beyond(self, z: FloatArray) -> float:
        """How far coefficients and constants lie outside their bounds: a difference there would show nothing."""
        p = np.concatenate([z[: self.q] * self.scale, self._constants(z)])
        low, high = self._ends[:, [*self._own, *self._shared]]
        size = np.maximum(np.abs(p), 1e-300)
        return float(np.sum((np.maximum(low - p, 0.0) + np.maximum(p - high, 0.0)) / size))

    def first(self, which: int, z: FloatArray) -> FloatArray:
        """Initial state of one record (nx,)."""
        begin = self.q + self.c + which * self.nx
        first: FloatArray = self.initial[which] + self._state_scale * z[begin : begin + self.nx]
        return first
