"""The plant's true parameters: what no estimator can have, and every comparison needs as its upper end."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup
from adaptive_flot.greybox.model import FloatArray
from estimators.fixed import Fixed, FixedState


@dataclass(frozen=True)
class OracleState:
    """State of the simulation inside."""

    inner: FixedState


class Oracle:
    """Simulates the model with the true parameters of each interval (`setup.truth`); nominal ones where none are given.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters, and the true parameters (N, np), row k for the interval that
        starts at k dt. The runner gives them to estimators with `needs_truth` and to no other.
    """

    needs_truth = True
    """Asks the runner for the truth; no estimator that runs on a plant can."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._fixed = Fixed(setup)
        self._columns = setup.model.indices("parameters", setup.parameters)

    def init(self, prior: Prior) -> OracleState:
        """Start at the prior's state."""
        return OracleState(self._fixed.init(prior))

    def update(self, state: OracleState, sample: Sample) -> tuple[OracleState, Estimate]:
        """Predict with the true parameters of the interval; see `Estimator.update`."""
        inner = replace(state.inner, theta=self._true(state.inner))
        new, estimate = self._fixed.update(inner, sample)
        return OracleState(new), estimate

    def _true(self, state: FixedState) -> FloatArray:
        if self.setup.truth is None:
            return state.theta
        row = min(round(state.time / self.setup.dt), len(self.setup.truth) - 1)
        return np.array(self.setup.truth[row, self._columns])
