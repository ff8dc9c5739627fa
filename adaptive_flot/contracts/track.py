"""Estimates over a whole record, as arrays: what a table or a figure is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Status
from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class Track:
    """Estimates at N samples; row k belongs to sample k. See `Estimate` for each.

    Attributes
    ----------
    time
        (N,) [s].
    prediction
        (N, ny).
    innovation_std
        (N, m).
    parameters
        (N, q).
    covariance
        (N, q, q).
    state
        (N, nx).
    statuses
        N of them.
    """

    time: FloatArray
    prediction: FloatArray
    innovation_std: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    state: FloatArray
    statuses: tuple[Status, ...]

    @classmethod
    def of(cls, estimates: Sequence[Estimate]) -> Track:
        """Collect estimates, at least one."""
        return cls(
            np.array([e.time for e in estimates]),
            np.array([e.prediction for e in estimates]),
            np.array([e.innovation_std for e in estimates]),
            np.array([e.parameters for e in estimates]),
            np.array([e.covariance for e in estimates]),
            np.array([e.state for e in estimates]),
            tuple(e.status for e in estimates),
        )

    @classmethod
    def joined(cls, parts: Sequence[Track]) -> Track:
        """Put parts of a record behind one another."""
        return cls(
            np.concatenate([p.time for p in parts]),
            np.concatenate([p.prediction for p in parts]),
            np.concatenate([p.innovation_std for p in parts]),
            np.concatenate([p.parameters for p in parts]),
            np.concatenate([p.covariance for p in parts]),
            np.concatenate([p.state for p in parts]),
            tuple(status for p in parts for status in p.statuses),
        )

    def end(self, noise_std: FloatArray) -> Prior:
        """Where an estimator would go on after the last sample, with the noise (m,) it had."""
        return Prior(float(self.time[-1]), self.state[-1], self.parameters[-1], self.covariance[-1], noise_std)
