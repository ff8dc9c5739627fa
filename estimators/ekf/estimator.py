"""Joint extended Kalman filter of states and parameters, parameters as random walks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.fastcall import FastCall
from estimators.shared.coordinates import Coordinates
from estimators.shared.drift import Drift, drift_of
from estimators.shared.joint_filter import filter_step, first_estimate, layout, parameters_of, process_noise
from estimators.shared.measured import driving_outputs

Walk = Literal["random", "integrated"]


@dataclass(frozen=True)
class EkfState:
    """What the next step needs.

    Attributes
    ----------
    time
        Time of z [s].
    z
        States, parameter coordinates and, with an integrated walk, drift rates (n,).
    P
        Their covariance (n, n).
    noise_std
        Standard deviation of the noise of each driving output (m,).
    """

    time: float
    z: FloatArray
    P: FloatArray
    noise_std: FloatArray


class Ekf:
    """Estimates states and parameters together from any measured outputs; see `joint_filter.py` for the equations.

    A measured output corrects everything that it says something about: a grade the parameters, a level the level. An
    output that is missing leaves its term out; without any the filter predicts, and its covariance grows by the drift.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    drift_per_hour
        How far a parameter drifts within an hour, as a share of it: one standard deviation for all, or by parameter.
        `estimators.ekf.likely_drift.most_likely_drift` finds it in a record.
    walk
        `random`: parameters do a random walk; `integrated`: their rate does.
    state_noise
        Standard deviation that unknown disturbances add to each state within a second, as a share of its scale; 0
        trusts the model's equations.
    outlier_std
        Innovations beyond so many standard deviations are not believed, see `joint_filter.filter_step`.

    Raises
    ------
    ModelError
        An option outside its range, or a parameter that is not adapted.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        drift_per_hour: Drift = 0.06,
        walk: Walk = "random",
        state_noise: float = 0.0,
        outlier_std: float = 10.0,
    ) -> None:
        if walk not in ("random", "integrated"):
            raise ModelError(f"ekf: unknown walk {walk!r}; {near_match(walk, ['random', 'integrated'])}")
        if not state_noise >= 0:
            raise ModelError(f"ekf: state_noise = {state_noise:g}; give 0 or a positive share")
        if not outlier_std > 0:
            raise ModelError(f"ekf: outlier_std = {outlier_std:g}; give a positive number of standard deviations")
        self.setup = setup
        self.outlier_std = outlier_std
        self.coordinates = Coordinates.of(setup.model, setup.parameters)
        self.layout = layout(setup, integrated=walk == "integrated")
        drift = drift_of(setup, drift_per_hour, "ekf")
        self.noise = process_noise(setup, self.coordinates, self.layout, drift, state_noise)
        self.columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values
        self._step = FastCall(
            filter_step(setup, self.layout, outlier_std),
            matrices=("P", "Q", "P_next"),
            as_machine_code=setup.model.compiled,
        )

    def init(self, prior: Prior) -> EkfState:
        """Start from a prior; without a joint covariance the state is taken as known."""
        return EkfState(prior.time, *first_estimate(prior, self.coordinates, self.layout), prior.noise_std.copy())

    def update(self, state: EkfState, sample: Sample) -> tuple[EkfState, Estimate]:
        """Predict, compare, correct; see `Estimator.update`."""
        measured, driving, present = driving_outputs(sample, self.columns, len(self.setup.model.outputs))
        p = self._p if sample.parameters is None else sample.parameters
        z, P, prediction, expected_std, _, flags = self._step(
            state.z, state.P, self.noise, state.time, sample.inputs, p, state.noise_std, driving, present
        )
        status = Status.OK if present.any() else Status.MISSING
        if not math.isfinite(flags[0]):
            z, P, status = state.z, state.P, Status.NOT_FINITE
        elif flags[1] > 0:
            status = Status.PROJECTED
        theta, covariance = parameters_of(z, P, self.coordinates, self.layout)
        estimate = Estimate(
            time=sample.time,
            prediction=prediction,
            innovation=measured - prediction,
            innovation_std=expected_std,
            parameters=theta,
            covariance=covariance,
            state=z[: self.layout.nx].copy(),
            status=status,
        )
        return EkfState(sample.time, z, P, state.noise_std), estimate
