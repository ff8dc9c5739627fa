"""Interacting multiple models: rest, one parameter drifts, one parameter jumps; which one is found from the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.imm.mixing import combine_function, mix_function
from estimators.imm.modes import Kind, Mode, make_modes, stationary, transitions
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import filter_step, first_estimate, layout, parameters_of
from estimators.shared.measured import driving_outputs


@dataclass(frozen=True)
class ImmState:
    """What the next step needs, for M modes.

    Attributes
    ----------
    time
        Time of z [s].
    z
        States, parameter coordinates and drift rates of each mode (n, M).
    P
        Their covariances side by side (n, n M).
    probability
        Probability of each mode (M,).
    noise_std
        Standard deviation of the noise of each driving output (m,).
    """

    time: float
    z: FloatArray
    P: FloatArray
    probability: FloatArray
    noise_std: FloatArray


class Imm:
    """Joint extended Kalman filters, one for each kind of change, that share what they know (Blom & Bar-Shalom 1988).

    Parameters drift one at a time and then rest: a random walk of all at once, as in `ekf`, describes that badly, and
    where two parameters compensate (n and C of the cell) it smears a drift of one over both. Here the modes are:
    nothing changes; parameter i drifts at a nearly constant rate; parameter i jumps. A filter runs for each, its rate
    starting from zero whenever its mode begins; their likelihoods give the mode probabilities, and the estimate is the
    mean over the modes.

    Equations: Bar-Shalom, Li & Kirubarajan (2001), section 11.6.6 (interaction, mode-matched filtering, probability
    update, combination); each filter is that of `joint_filter.py`.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    rate_per_hour
        Standard deviation of the rate with which a parameter begins to drift, as a share of it an hour.
    rate_change_per_hour
        Standard deviation by which the rate of a drift changes within an hour.
    jump
        Standard deviation of what a jump adds within a second, as a share of the parameter.
    rest_s, drift_s, jump_s
        Mean duration of rest, drift and jump [s].
    jump_share
        Share of jumps among the changes.
    state_noise, outlier_std
        As for `ekf`.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        rate_per_hour: float = 1.0,
        rate_change_per_hour: float = 2.0,
        jump: float = 0.05,
        rest_s: float = 300.0,
        drift_s: float = 300.0,
        jump_s: float = 3.0,
        jump_share: float = 0.2,
        state_noise: float = 0.0,
        outlier_std: float = 10.0,
    ) -> None:
        positive = (rate_per_hour, rate_change_per_hour, jump, rest_s, drift_s, jump_s, outlier_std)
        if not (min(positive) > 0 and 0 <= jump_share <= 1 and state_noise >= 0):
            raise ModelError(
                "imm: rates, jump, durations and outlier_std must be positive, jump_share a share, state_noise not "
                "negative; correct the options"
            )
        self.setup = setup
        self.coordinates = Coordinates.of(setup.model, setup.parameters)
        self.layout = layout(setup, integrated=True)
        rates = (rate_per_hour, rate_change_per_hour, jump)
        self.modes: tuple[Mode, ...] = make_modes(setup, self.coordinates, self.layout, *rates, state_noise)
        durations: dict[Kind, float] = {"rest": rest_s, "drift": drift_s, "jump": jump_s}
        self.transitions = transitions(self.modes, durations, jump_share, setup.dt)
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values
        step = filter_step(setup, self.layout, outlier_std)
        mix = mix_function(self.layout, self.modes, self.transitions)
        combine = combine_function(self.layout, len(self.modes))
        code = setup.model.compiled
        self._step = FastCall(step, matrices=("P", "Q", "P_next"), as_machine_code=code)
        self._mix = FastCall(mix, matrices=("z", "P"), as_machine_code=code)
        self._combine = FastCall(combine, matrices=("z", "P", "covariance"), as_machine_code=code)

    def init(self, prior: Prior) -> ImmState:
        """Start from a prior, every mode alike and with the share of time that the process spends in it."""
        z, P = first_estimate(prior, self.coordinates, self.layout)
        count = len(self.modes)
        return ImmState(
            prior.time,
            np.tile(z[:, None], (1, count)),
            np.hstack([P + mode.entry for mode in self.modes]),
            stationary(self.transitions),
            prior.noise_std.copy(),
        )

    def update(self, state: ImmState, sample: Sample) -> tuple[ImmState, Estimate]:
        """Mix, predict, compare, correct, weigh; see `Estimator.update`."""
        measured, driving, present = driving_outputs(sample, self._columns, len(self.setup.model.outputs))
        p = self._p if sample.parameters is None else sample.parameters
        n, count = self.layout.size, len(self.modes)
        mixed, mixed_P, expected = self._mix(state.z, state.P, state.probability)
        z, P = np.empty_like(mixed), np.empty_like(mixed_P)
        predictions, stds = np.empty((count, measured.size)), np.empty((count, driving.size))
        log_likelihood, flags = np.empty(count), np.empty((count, 2))
        for j, mode in enumerate(self.modes):
            block = slice(j * n, (j + 1) * n)
            z[:, j], P[:, block], predictions[j], stds[j], log_likelihood[j : j + 1], flags[j] = self._step(
                mixed[:, j],
                mixed_P[:, block],
                mode.noise,
                state.time,
                sample.inputs,
                p,
                state.noise_std,
                driving,
                present,
            )
        status = Status.OK if present.any() else Status.MISSING
        prediction = expected @ predictions
        variance = expected @ (stds**2 + (predictions[:, self._columns] - prediction[self._columns]) ** 2)
        if not (np.isfinite(flags[:, 0]).all() and np.isfinite(log_likelihood).all()):
            z, P, probability, status = state.z, state.P, state.probability, Status.NOT_FINITE
        else:
            weights = expected * np.exp(log_likelihood - log_likelihood.max())
            probability = weights / weights.sum()
            if flags[probability.argmax(), 1] > 0:
                status = Status.PROJECTED
        mean, covariance = self._combine(z, P, probability)
        theta, theta_covariance = parameters_of(mean, covariance, self.coordinates, self.layout)
        estimate = Estimate(
            time=sample.time,
            prediction=prediction,
            innovation=measured - prediction,
            innovation_std=np.sqrt(variance),
            parameters=theta,
            covariance=theta_covariance,
            state=mean[: self.layout.nx].copy(),
            status=status,
        )
        return ImmState(sample.time, z, P, probability, state.noise_std), estimate
