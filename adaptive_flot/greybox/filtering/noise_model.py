"""How large the noise of a model in innovations form is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model

STUDENT = 5.0
"""Degrees of freedom of the innovations: tails heavy enough that one absurd value decides nothing."""


@dataclass(frozen=True)
class NoiseModel:
    """Process noise, measurement noise and walking parameters.

    The states follow ``dx = f(x, u, p) dt + q dw`` and walking parameters ``dp = s dw`` with independent standard
    Wiener processes w; the outputs are ``y = g(x, u, p) + e`` with e of standard deviation r. Kristensen, Madsen &
    Jorgensen, *Automatica* 40 (2004) 225, equations 1 and 2.

    Attributes
    ----------
    process
        q of each state by name, in its unit per square root of a second; states left out have none.
    measurement
        r of each output by name, in its unit.
    walk
        s of each walking parameter by name, in its unit per square root of a second.
    degrees_of_freedom
        Of Student's t distribution of the innovations; infinity is the Gaussian.
    """

    process: Mapping[str, float] = field(default_factory=dict)
    measurement: Mapping[str, float] = field(default_factory=dict)
    walk: Mapping[str, float] = field(default_factory=dict)
    degrees_of_freedom: float = STUDENT

    def variances(self, model: Model, dt: float) -> FloatArray:
        """Variance that one interval of `dt` [s] adds to each state and walking parameter (nx + w,)."""
        q = np.array([self.process.get(name, 0.0) for name in model.names("states")])
        s = np.array(list(self.walk.values()))
        added: FloatArray = np.concatenate([q, s]) ** 2 * dt
        return added

    def std(self, model: Model) -> FloatArray:
        """Standard deviation of each output's measurement (ny,); its scale times 1e-6 at least."""
        r = np.array([self.measurement.get(name, 0.0) for name in model.names("outputs")])
        floor = 1e-6 * np.array([o.scale for o in model.outputs])
        std: FloatArray = np.maximum(r, floor)
        return std
