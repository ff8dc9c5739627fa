"""Recursive prediction error method, as in Gonzalez & Quintanilla, equations (thetaupdate) and (lupdate)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.rpem.ensemble import RpemEnsemble
from estimators.rpem.record import BLOCK_ROWS, RecordBlock
from estimators.rpem.state import RpemState
from estimators.rpem.update import Gradient, UpdateOptions, alternative_covariance, update_function
from estimators.shared.ensemble import samples_of
from estimators.shared.information import Information
from estimators.shared.measured import driving_outputs
from estimators.shared.state_correction import StateCorrection

GRADIENTS = ("exact", "central", "recursive")


class Rpem:
    """Tracks parameters by a Gauss-Newton step a sample with exponential forgetting.

    With eta_N the output residual of the one-step prediction from the previous state with the newest estimate, and
    psi_N its derivative for that state held::

        L_N     = (L_{N-1} - L_{N-1} psi_N (lambda + psi_N' L_{N-1} psi_N)^-1 psi_N' L_{N-1}) / lambda     (lupdate)
        theta_N = theta_{N-1} + L_N psi_N eta_N                                                        (thetaupdate)

    Outputs are divided by their noise standard deviation, so that sigma^2 L, the covariance, takes the place of L; for
    one output this changes nothing in theta, for several it weighs them. A missing output leaves its term out; when
    all are missing nothing is forgotten.

    The defaults are the paper. What goes beyond it is an option; `rpem_full` has other defaults.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    forgetting
        Forgetting factor lambda in (0, 1]; 1 / (1 - lambda) samples is the memory.
    gradient
        `exact`: forward sensitivities of the step with the state before it held; `central`: the same by second-order
        central differences, four more simulations a sample, as the paper prints; `recursive`: the sensitivity of the
        state is carried along, psi counts what past estimates did to the state (Ljung & Soderstrom, *Theory and
        Practice of Recursive Identification* (1983), section 3.8).
    l0_scale
        Factor on the prior covariance ("L_0 is chosen proportional to the empirical covariance").
    forget_to
        Stabilised forgetting: the inverse of L is forgotten towards that of a parameter known to within this share
        of it, (lambda L^-1 + (1 - lambda) A^-1)^-1, and not towards nothing. So the covariance stays below A where
        nothing excites, instead of growing without end (Kulhavy & Zarrop, Int. J. Control 58 (1993)). Default: the
        exponential forgetting of the paper.
    freeze_s
        Freeze each direction of theta on which the data of this time [s] say less than A: the estimate does not move
        along it and the status is LOW_INFORMATION. Needs `forget_to`. Default: never.
    correct_state
        Measured outputs that correct the state, driving or not, with the standard deviation of their noise in the
        output's unit, by the gain of a stationary Kalman filter (see `state_correction.py`). Default none: the state
        is the free run of the paper.
    state_noise
        For that gain: standard deviation that unknown disturbances add to each state within a second, as a share of
        its scale.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        forgetting: float = 0.995,
        gradient: Gradient = "exact",
        l0_scale: float = 1.0,
        forget_to: float | None = None,
        freeze_s: float | None = None,
        correct_state: Mapping[str, float] | None = None,
        state_noise: float = 1e-3,
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise ModelError(f"rpem: forgetting = {forgetting:g}; give a factor in (0, 1], for example 0.995")
        if gradient not in GRADIENTS:
            raise ModelError(f"rpem: unknown gradient {gradient!r}; {near_match(gradient, GRADIENTS)}")
        if not l0_scale > 0.0:
            raise ModelError(f"rpem: l0_scale = {l0_scale:g}; give a positive factor")
        if forget_to is not None and not forget_to > 0.0:
            raise ModelError(f"rpem: forget_to = {forget_to:g}; give a positive share, for example 0.05")
        if freeze_s is not None and (forget_to is None or not freeze_s > 0.0):
            raise ModelError(f"rpem: freeze_s = {freeze_s:g} needs a positive time and forget_to; give both")
        self.setup = setup
        self.l0_scale = l0_scale
        alternative = None if forget_to is None else alternative_covariance(setup, forget_to)
        self._correction = StateCorrection(setup, correct_state or {}, state_noise)
        self.options = UpdateOptions(forgetting, gradient, alternative, self._correction.outputs, freeze_s is not None)
        self._information = None if alternative is None or freeze_s is None else Information(alternative, freeze_s)
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values
        self._block: RecordBlock | None = None
        if self._information is None and not self._correction.outputs:
            self._block = RecordBlock(setup, self.options)
        matrices = ("S", "covariance", "free", "gain", "S_next", "covariance_next", "information")
        self._function = update_function(setup, self.options)
        self._update = FastCall(self._function, matrices=matrices, as_machine_code=setup.model.compiled)
        self._recursive = gradient == "recursive"

    def init(self, prior: Prior) -> RpemState:
        """Start from a prior, L_0 from its covariance, the sensitivity of the state from what ties it to them."""
        nx, q = len(self.setup.model.states), len(self.setup.parameters)
        sensitivity = np.zeros((nx, q))
        if prior.joint_covariance is not None:
            sensitivity = prior.joint_covariance[:nx, nx:] @ np.linalg.pinv(prior.covariance, hermitian=True)
        return RpemState(
            prior.time,
            prior.state.copy(),
            prior.parameters.copy(),
            self.l0_scale * prior.covariance,
            prior.core_noise.copy(),
            sensitivity,
            np.zeros((q, q)) if self._information is None else self._information.start(prior.covariance),
            None,
        )

    def update(self, state: RpemState, sample: Sample) -> tuple[RpemState, Estimate]:
        """Predict, compare, correct; see `Estimator.update`."""
        measured, outputs, present = driving_outputs(sample, self._columns, len(self.setup.model.outputs))
        p = self._p if sample.parameters is None else sample.parameters
        extra, correction, starved = [], state.correction, False
        if self._recursive:
            extra.append(state.sensitivity)
        if self._information is not None:
            free, starved = self._information.free_directions(state.information)
            extra.append(free)
        if self._correction.outputs:
            if correction is None:
                correction = self._correction.design(state.x, state.time, sample.inputs, p, state.theta)
            _, seen, there = driving_outputs(sample, self._correction.rows, len(self.setup.model.outputs))
            extra += [correction.gain, correction.reach, seen, there]
        x, theta, covariance, prediction, expected_std, flags, *more = self._update(
            state.x,
            state.time,
            sample.inputs,
            p,
            state.theta,
            state.covariance,
            state.noise_std,
            outputs,
            present,
            *extra,
        )
        sensitivity, information = state.sensitivity, state.information
        status = Status.OK if flags[2] > 0 else Status.MISSING
        if not math.isfinite(flags[0]):
            x, theta, covariance, status = state.x, state.theta, state.covariance, Status.NOT_FINITE
        else:
            if self._recursive:
                sensitivity = more[0]
            if self._information is not None:
                information = self._information.add(information, more[-1], self.setup.dt)
            if flags[1] > 0:
                status = Status.PROJECTED
            elif starved and status is Status.OK:
                status = Status.LOW_INFORMATION
        new = RpemState(sample.time, x, theta, covariance, state.noise_std, sensitivity, information, correction)
        estimate = Estimate(
            sample.time,
            prediction,
            measured - prediction,
            expected_std,
            theta.copy(),
            covariance.copy(),
            x.copy(),
            status,
        )
        return new, estimate

    def track(self, state: RpemState, time: FloatArray, inputs: FloatArray, outputs: FloatArray) -> Track:
        """Take a whole record: the estimates that `update` gives sample by sample, without a Python call for each.

        Parameters
        ----------
        state
            Before the first sample.
        time, inputs, outputs
            Of each sample, (N,), (N, nu) and (N, ny), NaN where missing.
        """
        parts: list[Track] = []
        for first in range(0, len(time), BLOCK_ROWS):
            rows = slice(first, first + BLOCK_ROWS)
            block = (time[rows], inputs[rows], outputs[rows])
            taken = None if self._block is None or len(time[rows]) < BLOCK_ROWS else self._block(state, *block)
            state, part = self._by_samples(state, *block) if taken is None else taken
            parts.append(part)
        return Track.joined(parts)

    def track_ensemble(self, states: Sequence[RpemState], record: EnsembleRecord) -> list[tuple[RpemState, Track]]:
        """Take the records of many members at once; see `TracksEnsembles`."""
        tracked = self._ensemble(states, record)
        return [
            self._one_by_one(state, samples_of(record, m)) if found is None else found
            for m, (state, found) in enumerate(zip(states, tracked, strict=True))
        ]

    @cached_property
    def _ensemble(self) -> RpemEnsemble:
        # made when first asked for: compiling it takes seconds
        return RpemEnsemble(self.setup, self.options, self._correction, self._information, self._function)

    def _by_samples(
        self, state: RpemState, time: FloatArray, inputs: FloatArray, outputs: FloatArray
    ) -> tuple[RpemState, Track]:
        return self._one_by_one(state, [Sample(float(t), u, y) for t, u, y in zip(time, inputs, outputs, strict=True)])

    def _one_by_one(self, state: RpemState, samples: Sequence[Sample]) -> tuple[RpemState, Track]:
        estimates: list[Estimate] = []
        for sample in samples:
            state, estimate = self.update(state, sample)
            estimates.append(estimate)
        return state, Track.of(estimates)
