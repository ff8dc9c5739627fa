"""Coordinates in which parameters are estimated: itself, or its logarithm for a positive parameter with a dimension.

A filter describes what it knows by a mean and a covariance. That fits a rate constant whose effect is proportional, and
pairs of parameters that trade off against each other as a power law, much better in logarithms: the ridge along which n
and C of the cell compensate is curved in C and straight in log C. A parameter without dimension (an exponent) or one
that may be zero or negative is estimated as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model


@dataclass(frozen=True)
class Coordinates:
    """Map between q parameters and their coordinates.

    Attributes
    ----------
    log
        Whether each coordinate is the natural logarithm of its parameter (q,).
    scale
        What counts as a change of 100 % in each coordinate (q,): 1 for a logarithm, the nominal value's size else.
    lower, upper
        Range of each coordinate (q,).
    range
        Range of each parameter (q, 2).
    """

    log: tuple[bool, ...]
    scale: FloatArray
    lower: FloatArray
    upper: FloatArray
    range: FloatArray

    @classmethod
    def of(cls, model: Model, names: Sequence[str]) -> Coordinates:
        """Coordinates of named parameters of a model."""
        parameters = [model.parameters[i] for i in model.indices("parameters", names)]
        log = tuple(p.varies_by_factor for p in parameters)
        limits = np.array([[p.lower, p.upper] for p in parameters], dtype=float)
        bounds = limits.copy()
        bounds[list(log)] = np.log(bounds[list(log)])
        size = [1.0 if is_log else abs(p.value) or p.scale for p, is_log in zip(parameters, log, strict=True)]
        return cls(log, np.array(size), bounds[:, 0], bounds[:, 1], limits)

    def from_parameters(self, theta: FloatArray) -> FloatArray:
        """Coordinates of parameter values (q,)."""
        return np.array([np.log(v) if is_log else v for v, is_log in zip(theta, self.log, strict=True)])

    def to_parameters(self, c: FloatArray) -> FloatArray:
        """Parameter values (q,); on a bound exactly its value, which exp(log(.)) may miss by a rounding error."""
        values: FloatArray = np.array([np.exp(v) if is_log else v for v, is_log in zip(c, self.log, strict=True)])
        inside: FloatArray = np.clip(values, self.range[:, 0], self.range[:, 1])
        return inside

    def slopes(self, c: FloatArray) -> FloatArray:
        """Derivative of each parameter for its coordinate (q,)."""
        return np.array([np.exp(v) if is_log else 1.0 for v, is_log in zip(c, self.log, strict=True)])

    def symbolic(self, c: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Parameters and their derivatives for the coordinates, as expressions (q,)."""
        values = [ca.exp(c[i]) if is_log else c[i] for i, is_log in enumerate(self.log)]
        slopes = [v if is_log else ca.SX(1.0) for v, is_log in zip(values, self.log, strict=True)]
        return ca.vertcat(*values), ca.vertcat(*slopes)
