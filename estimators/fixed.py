"""Fixed parameters: the baseline of every comparison, and the smallest example of an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status, full_parameters
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping import step_functions
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.shared.ensemble import samples_of, statuses


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

    # -- many members at once: an estimator need not have this ---------------------------------------------------------

    def track_ensemble(self, states: Sequence[FixedState], record: EnsembleRecord) -> list[tuple[FixedState, Track]]:
        """Take the records of many members at once; see `TracksEnsembles`."""
        model, members, rows = self.setup.model, len(record), len(record.time)
        usual = np.tile(model.parameter_values, (members, 1))
        p = usual if record.parameters is None else record.parameters.copy()
        adapted = model.indices("parameters", self.setup.parameters)
        theta = np.array([s.theta for s in states])
        p[..., adapted] = theta if p.ndim == 2 else theta[:, None]
        fixed = {"x": np.array([s.x for s in states])} | ({"p": p} if p.ndim == 2 else {})
        by_row = {"t": record.times_before([s.time for s in states]), "u": record.inputs}
        by_row |= {"p": p} if p.ndim == 3 else {}
        found = self._lanes(members, rows, fixed, by_row, every=["x_next", "y"])
        return [self._member(s, record, m, found["x_next"][m], found["y"][m]) for m, s in enumerate(states)]

    @cached_property
    def _lanes(self) -> Lanes:
        model = self.setup.model
        step = model.derived(step_functions.step, Interval(self.setup.dt, model.steps_in(self.setup.dt)))
        return Lanes(step, {"x": "x_next"}, as_machine_code=model.compiled)

    def _member(
        self, state: FixedState, record: EnsembleRecord, member: int, x: FloatArray, y: FloatArray
    ) -> tuple[FixedState, Track]:
        if not (np.isfinite(x).all() and np.isfinite(y[:, self._columns]).all()):  # a sample to skip
            estimates = []
            for sample in samples_of(record, member):
                state, estimate = self.update(state, sample)
                estimates.append(estimate)
            return state, Track.of(estimates)
        rows, q = len(x), state.theta.size
        present = np.isfinite(record.outputs[member][:, self._columns]).any(axis=1)
        track = Track(
            record.time,
            y,
            np.tile(state.noise_std, (rows, 1)),
            np.tile(state.theta, (rows, 1)),
            np.zeros((rows, q, q)),
            x,
            statuses(np.zeros(rows, dtype=bool), present),
        )
        return replace(state, time=float(record.time[-1]), x=x[-1].copy()), track
