"""Adaptive interacting multiple models: one estimator for every kind of change, that says when the model is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.adaptive_imm.bank import Contamination, Mixing, Triangles
from estimators.adaptive_imm.disturbances import extended, with_disturbances
from estimators.adaptive_imm.ensemble import track_members
from estimators.adaptive_imm.modes import KINDS, Changes, Modes, transitions
from estimators.adaptive_imm.options import check_modes, check_numbers, check_shares
from estimators.adaptive_imm.region import LongRun
from estimators.adaptive_imm.state import LAST, MORE_LIKELY, AdaptiveImmState, NoiseLevel
from estimators.adaptive_imm.step import CARRIED, MATRICES, Step
from estimators.adaptive_imm.trust import Trust
from estimators.imm.modes import stationary
from estimators.shared.coordinates import Coordinates
from estimators.shared.ensemble import Flags
from estimators.shared.joint_filter import first_estimate, layout
from estimators.shared.measured import driving_outputs


class AdaptiveImm:
    """Joint Kalman filters, one for each kind of change, that share one linearisation and what they know.

    The modes are: rest; one parameter drifts; all drift, each at a rate of its own; one jumps; all do a random walk.
    Beside them stands a walk with a *discrepancy*: each driving output is off by an amount that comes and goes, which
    no parameter explains. Noise has outliers, and its level is estimated. Disturbances that nobody measures are
    estimated beside the parameters; they walk and jump. See the modules of this package for the equations, and
    `interval.py` for why the point of linearisation lags behind the estimate.

    The covariance is wider than that of these modes. Each kind of change claims to know the direction in which the
    parameters compensate, and is wrong where the process does something else. So it is no narrower than a share of that
    of the *reference*, a fast walk, and grows where the innovations stay on one side; see `region.py`.

    Where the first record's fit left errors that are not white, the model is wrong from the start; see `trust.py`.

    The status is `Status.MODEL_ERROR` in two cases. The modes with a discrepancy are more likely than not, on the
    average of the last ten samples or so. Or a parameter is farther than `plausible` from its nominal value, by more
    than two standard deviations. Then the parameters take up what the model lacks; `discover` looks for it.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    modes
        Kinds of change: of `rest`, `drift`, `joint_drift`, `jump`, `walk`.
    rate_per_hour, joint_rate_per_hour, rate_change_per_hour, jump, disturbance_jump, walk_per_hour, \
    background_per_hour, reference_per_hour, state_noise
        How far parameters and disturbances move, see `Changes`.
    reference_share
        Share of the reference's covariance below which the covariance does not go, along any direction.
    average_s, long_run_s
        Time constants of the average of the innovations, and of its variance [s]; a `long_run_s` of 0 leaves the
        covariance as it is.
    change_s, jump_s, walk_s
        Mean duration of rest and of a drift, of a jump, and of a random walk [s].
    shares
        Share of the changes that are a drift of all, a jump, and a walk; the others are drifts of one.
    outlier_share, outlier_scale
        Share of the measurements that are outliers, and their standard deviation as a multiple of the noise.
    noise_memory
        Samples over which the noise level is estimated; 0 takes that of the prior.
    discrepancies
        Standard deviations of a discrepancy, as multiples of the noise; none trusts the model.
    discrepancy_s
        Time constant with which a discrepancy comes and goes [s].
    right_s, wrong_s
        Mean time until the model becomes wrong, and for which it stays so [s].
    lag_s
        Time constant with which the point of linearisation follows the estimate [s]; 0 takes the estimate.
    plausible
        Distance of a parameter from its nominal value, as a share of it, beyond which it explains something else; and
        standard deviation with which the nominal value counts at the start.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        modes: Sequence[str] = KINDS,
        rate_per_hour: float = 1.0,
        joint_rate_per_hour: float = 0.7,
        rate_change_per_hour: float = 0.2,
        jump: float = 0.05,
        disturbance_jump: float = 0.2,
        walk_per_hour: float = 0.1,
        background_per_hour: float = 0.003,
        reference_per_hour: float = 0.3,
        reference_share: float = 0.18,
        average_s: float = 30.0,
        long_run_s: float = 600.0,
        state_noise: float = 0.0,
        change_s: float = 450.0,
        jump_s: float = 3.0,
        walk_s: float = 600.0,
        shares: Sequence[float] = (0.2, 0.2, 0.02),
        outlier_share: float = 0.01,
        outlier_scale: float = 20.0,
        noise_memory: int = 600,
        discrepancies: Sequence[float] = (6.0, 20.0),
        discrepancy_s: float = 200.0,
        right_s: float = 24000.0,
        wrong_s: float = 1200.0,
        lag_s: float = 100.0,
        plausible: float = 0.5,
    ) -> None:
        rates = rate_per_hour, joint_rate_per_hour, rate_change_per_hour
        walks = walk_per_hour, background_per_hour, reference_per_hour if reference_share else 0.0
        changes = Changes(*rates, jump, disturbance_jump, *walks, state_noise)
        check_modes(modes)
        check_numbers(
            {**vars(changes), "lag_s": lag_s, "noise_memory": noise_memory, "long_run_s": long_run_s},
            {"change_s": change_s, "jump_s": jump_s, "walk_s": walk_s, "average_s": average_s}
            | {"outlier_scale": outlier_scale, "discrepancy_s": discrepancy_s}
            | {"right_s": right_s, "wrong_s": wrong_s, "plausible": plausible}
            | {f"discrepancies[{i}]": level for i, level in enumerate(discrepancies)},
        )
        check_shares(outlier_share, reference_share, shares)
        self.setup = setup
        whole = with_disturbances(setup)
        self.coordinates = Coordinates.of(setup.model, whole.parameters)
        self.layout = layout(whole, integrated=True)
        self.modes = Modes.of(whole, self.coordinates, self.layout, modes, changes, discrepancies)
        joint, jumps, walking = shares
        matrix = transitions(
            self.modes,
            {"rest": change_s, "drift": change_s, "joint_drift": change_s, "jump": jump_s, "walk": walk_s},
            {"drift": 1 - joint - jumps - walking, "joint_drift": joint, "jump": jumps, "walk": walking},
            (right_s, wrong_s),
            setup.dt,
        )
        nx, q, n = self.layout.nx, self.layout.q, self.layout.size
        off = (self.modes.discrepancy > 0).astype(float)
        self._b = slice(n, n + len(setup.outputs))
        mixing = Mixing(matrix, self.modes.entry, slice(nx + q, n), self._b, off)
        fading, follow = np.exp(-setup.dt / discrepancy_s), 1.0 if lag_s == 0 else -np.expm1(-setup.dt / lag_s)
        contamination = Contamination(outlier_share, outlier_scale)
        parts = Step(
            self.modes,
            mixing,
            contamination,
            float(fading),
            float(follow),
            reference_share,
            LongRun(setup.dt, average_s, long_run_s),
            noise_memory,
        )
        self._described = parts.described
        self.transitions, self.plausible = matrix, plausible
        self.off = off
        self.columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values
        nominal = setup.model.parameter_values[setup.model.indices("parameters", whole.parameters)]
        self._nominal = self.coordinates.from_parameters(nominal)
        self._plausible_std = plausible * self.coordinates.scale
        self._made = parts.function(whole, self.layout)
        self._step = FastCall(self._made, matrices=MATRICES, as_machine_code=setup.model.compiled)

    def init(self, prior: Prior) -> AdaptiveImmState:
        """Start from a prior, every mode alike and with the share of time that the process spends in it."""
        first, first_P = first_estimate(extended(prior, self.setup), self.coordinates, self.layout)
        trust = Trust.of(prior.colour, doubts=bool(self.off.any()))
        if prior.ongoing:
            first_P = trust.undone(first_P)
        else:
            first, first_P = trust.start(first, first_P, self.layout.coordinates, self._nominal, self._plausible_std)
        scale = np.array([self.setup.model.outputs[j].scale for j in self.columns])
        noise = NoiseLevel.first(prior.core_noise, scale)
        size, n, count = self._b.stop, self.layout.size, len(self.modes.kinds)
        z, P = np.zeros((size, count)), np.zeros((size, size))
        z[:n], P[:n, :n] = first[:, None], first_P
        variances = self.modes.entry.T.copy()
        variances[self._b] = noise.variance[:, None] * self.modes.discrepancy**2
        shape = Triangles(size)
        triangles = P[shape.rows, shape.columns][:, None] + shape.on_diagonal(variances)
        lagged = first[self.layout.coordinates].copy()
        region = first_P[self.layout.coordinates, self.layout.coordinates].copy()
        known = self._described > 0
        probability = np.ones(count)
        probability[known] = stationary(self.transitions[np.ix_(known, known)])
        return AdaptiveImmState(
            prior.time, z, triangles, probability, lagged, noise, LongRun.first(len(scale)), region, trust, trust.doubt
        )

    def update(self, state: AdaptiveImmState, sample: Sample) -> tuple[AdaptiveImmState, Estimate]:
        """Mix, predict, compare, correct, weigh; see `Estimator.update`."""
        measured, driving, present = driving_outputs(sample, self.columns, len(self.setup.model.outputs))
        noise, shape = state.noise, self.layout
        p = self._p if sample.parameters is None else sample.parameters
        z, P, probability, lagged, level, count, slow, prediction, std, mean, covariance, projected, finite = (
            self._step(
                state.z,
                state.P,
                state.probability,
                state.lagged,
                noise.variance,
                noise.count,
                state.slow,
                noise.least,
                state.time,
                sample.inputs,
                p,
                driving,
                present,
                state.trust.doubt,
            )
        )
        status = Status.OK if present.any() else Status.MISSING
        if not np.isfinite(finite[0]):
            z, P, probability, lagged, slow = state.z, state.P, state.probability, state.lagged, state.slow
            mean, covariance, status = z @ (probability * self._described), state.region, Status.NOT_FINITE
        else:
            noise = NoiseLevel(level, count, noise.least)
            if projected[0] > 0:
                status = Status.PROJECTED
        c, q = mean[shape.coordinates], len(self.setup.parameters)
        slopes, theta = self.coordinates.slopes(c), self.coordinates.to_parameters(c)
        theta_covariance = state.trust.shown(covariance * np.outer(slopes, slopes))
        wrong = state.wrong + (float(probability @ self.off) - state.wrong) / LAST
        if status is Status.OK and (wrong > MORE_LIKELY or self.is_far(mean[None], covariance[None])[0]):
            status = Status.MODEL_ERROR
        off = np.zeros(len(prediction))
        off[self.columns] = mean[self._b]
        estimate = Estimate(
            time=sample.time,
            prediction=prediction,
            innovation=measured - prediction,
            innovation_std=std,
            parameters=theta[:q],
            covariance=theta_covariance[:q, :q],
            state=mean[: shape.nx].copy(),
            status=status,
            discrepancy=off,
            disturbances=dict(zip(self.setup.unmeasured, theta[q:].tolist(), strict=True)),
            disturbance_std=dict(
                zip(self.setup.unmeasured, np.sqrt(np.diag(theta_covariance)[q:]).tolist(), strict=True)
            ),
        )
        return AdaptiveImmState(
            sample.time, z, P, probability, lagged, noise, slow, covariance, state.trust, wrong
        ), estimate

    def track_ensemble(
        self, states: Sequence[AdaptiveImmState], record: EnsembleRecord
    ) -> list[tuple[AdaptiveImmState, Track]]:
        """Take the records of many members at once; see `TracksEnsembles`."""
        return track_members(self, states, record)

    @cached_property
    def lanes(self) -> Lanes:
        """The step for many members; made when first asked for. In vector registers it would compile for minutes."""
        return Lanes(self._made, CARRIED, MATRICES, as_machine_code=self.setup.model.compiled, one_by_one=True)

    def is_far(self, mean: FloatArray, covariance: FloatArray) -> Flags:
        """Whether a parameter is beyond `plausible` (N,), from z (N, n) and covariances of coordinates (N, q, q)."""
        own = slice(0, len(self.setup.parameters))
        away = np.abs(mean[:, self.layout.coordinates] - self._nominal) - self._plausible_std
        spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        far: Flags = (away[:, own] > np.maximum(0.0, 2 * spread[:, own])).any(axis=1)
        return far
