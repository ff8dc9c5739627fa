"""Fixed parameters: the baseline of every comparison, and the smallest example of an estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status, full_parameters
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper


@dataclass(frozen=True)
class FixedState:
    """Time [s], model state (nx,), parameters (q,) and noise standard deviation of the driving outputs (m,)."""

    time: float
    x: FloatArray
    theta: FloatArray
    noise_std: FloatArray


class Fixed:
    """Simulates the model with the parameters it was given and never changes them.

    Its innovation is the free-run error of the model, so its fit is the "constant parameters" of the paper.

    Parameters
    ----------
    setup
        Model, sampling interval and the names of parameters and outputs.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._step = Stepper(setup.model, setup.dt).call

    def init(self, prior: Prior) -> FixedState:
        """Start from a prior. Its covariance is not used: what is never estimated has none (zero)."""
        return FixedState(prior.time, prior.state.copy(), prior.parameters.copy(), prior.noise_std.copy())

    def update(self, state: FixedState, sample: Sample) -> tuple[FixedState, Estimate]:
        """Predict one interval ahead; see `Estimator.update`."""
        model = self.setup.model
        if np.shape(sample.outputs) != (len(model.outputs),):
            raise ModelError(f"a sample has {np.shape(sample.outputs)} outputs, the model ({len(model.outputs)},)")
        p = full_parameters(model, self.setup.parameters, state.theta, sample.parameters)
        x, y, _ = self._step(state.x, state.time, sample.inputs, p)
        status = Status.OK if np.isfinite(sample.outputs[self._columns]).any() else Status.MISSING
        if not (np.isfinite(x).all() and np.isfinite(y[self._columns]).all()):
            x, status = state.x, Status.NOT_FINITE
        estimate = Estimate(
            time=sample.time,
            prediction=y,
            innovation=sample.outputs - y,
            innovation_std=state.noise_std.copy(),
            parameters=state.theta.copy(),
            covariance=np.zeros((state.theta.size, state.theta.size)),
            state=x.copy(),
            status=status,
        )
        return replace(state, time=sample.time, x=x), estimate
