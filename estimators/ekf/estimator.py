"""Joint extended Kalman filter of states and parameters, parameters as random walks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.shared.coordinates import Coordinates
from estimators.shared.drift import Drift, drift_of
from estimators.shared.ensemble import Flags, driving, known_parameters, samples_of, statuses
from estimators.shared.joint_filter import (
    filter_step,
    first_estimate,
    layout,
    parameters_of,
    parameters_of_rows,
    process_noise,
)
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

    def track_ensemble(self, states: Sequence[EkfState], record: EnsembleRecord) -> list[tuple[EkfState, Track]]:
        """Take the records of many members at once; see `TracksEnsembles`."""
        parameters = known_parameters(record, self._p)
        measured, present = driving(record, self.columns)
        fixed = {
            "z": np.array([s.z for s in states]),
            "P": np.array([s.P for s in states]),
            "Q": self.noise,
            "noise": np.array([s.noise_std for s in states]),
            **parameters["fixed"],
        }
        times = record.times_before([s.time for s in states])
        by_row = {"t": times, "u": record.inputs, "measured": measured, "present": present, **parameters["by_row"]}
        every = ["z_next", "P_next", "prediction", "expected_std", "flags"]
        rows = self._lanes(len(record), len(record.time), fixed, by_row, every=every)
        seen: Flags = np.asarray(present.max(axis=2) > 0)
        return [
            self._member({name: rows[name][m] for name in every}, states[m], record, m, seen[m])
            for m in range(len(states))
        ]

    @cached_property
    def _lanes(self) -> Lanes:
        # made when first asked for: compiling it takes seconds
        function = filter_step(self.setup, self.layout, self.outlier_std)
        carried = {"z": "z_next", "P": "P_next"}
        return Lanes(function, carried, ("P", "Q", "P_next"), as_machine_code=self.setup.model.compiled)

    def _member(
        self, rows: Mapping[str, FloatArray], state: EkfState, record: EnsembleRecord, m: int, present: Flags
    ) -> tuple[EkfState, Track]:
        """State after the samples and estimates of one member."""
        flags = rows["flags"]
        if not np.isfinite(flags[:, 0]).all():  # a sample to be skipped made all that came after it NaN
            estimates = []
            for sample in samples_of(record, m):
                state, estimate = self.update(state, sample)
                estimates.append(estimate)
            return state, Track.of(estimates)
        theta, covariance = parameters_of_rows(rows["z_next"], rows["P_next"], self.coordinates, self.layout)
        track = Track(
            record.time,
            rows["prediction"],
            rows["expected_std"],
            theta,
            covariance,
            rows["z_next"][:, : self.layout.nx],
            statuses(flags[:, 1] > 0, present),
        )
        last = EkfState(float(record.time[-1]), rows["z_next"][-1].copy(), rows["P_next"][-1].copy(), state.noise_std)
        return last, track
