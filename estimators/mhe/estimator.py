"""Moving-horizon estimation of states and parameters: the most likely trajectory of the last samples, within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.mhe.arrival import arrival_step
from estimators.mhe.problem import SOLVERS, HorizonWindow, MovingHorizon
from estimators.shared.coordinates import Coordinates
from estimators.shared.drift import Drift, drift_of
from estimators.shared.joint_filter import first_estimate, layout, parameters_of, process_noise
from estimators.shared.measured import driving_outputs


@dataclass(frozen=True)
class MheState:
    """What the next step needs, for a window of N intervals of which the first `count` are filled.

    Attributes
    ----------
    time
        Time of the newest z [s].
    count, since
        Samples in the window; samples since the last solution.
    mean, P
        Arrival: states and parameter coordinates at the start of the window (n,) and their covariance (n, n).
    newest_covariance
        Covariance of the newest z (n, n).
    z, w
        Trajectory (N + 1, n) and process noise (N, n) of the window; behind the newest, copies of it and zeros.
    window
        Its data; a sample that is not there yet has the weight zero.
    noise_std
        Standard deviation of the noise of each driving output (m,).
    """

    time: float
    count: int
    since: int
    mean: FloatArray
    P: FloatArray
    newest_covariance: FloatArray
    z: FloatArray
    w: FloatArray
    window: HorizonWindow
    noise_std: FloatArray


class Mhe:
    """Fits the last `window_s` seconds anew, with all that is older in an arrival cost.

    Where a Kalman filter linearises each interval once, before its measurement, the window is linearised where it turns
    out to have been, and its parameters stay within their bounds (`problem.py`). Between two solutions a sample is
    taken in by one Kalman step, which on a linear model is the same.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    window_s
        Length of the window [s].
    solve_every_s
        Time between two solutions [s].
    drift_per_hour, state_noise, outlier_std
        As for `ekf`. An innovation beyond `outlier_std` standard deviations is cut back to that before it enters.
    solver
        `ipopt` (Gauss-Newton Hessian) or `fatrop` (exact Hessian, stage structure).

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        window_s: float = 60.0,
        solve_every_s: float = 10.0,
        drift_per_hour: Drift = 0.06,
        state_noise: float = 0.0,
        outlier_std: float = 10.0,
        solver: str = "ipopt",
    ) -> None:
        if solver not in SOLVERS:
            raise ModelError(f"mhe: unknown solver {solver!r}; {near_match(solver, SOLVERS)}")
        if not (window_s > 0 and solve_every_s > 0 and outlier_std > 0 and state_noise >= 0):
            raise ModelError(
                "mhe: window_s, solve_every_s and outlier_std must be positive, state_noise not negative; correct them"
            )
        self.setup = setup
        self.coordinates = Coordinates.of(setup.model, setup.parameters)
        self.layout = layout(setup)
        self.rows = max(2, math.ceil(window_s / setup.dt - 1e-9))
        self.every = max(1, round(solve_every_s / setup.dt))
        self.outlier = outlier_std
        drift = drift_of(setup, drift_per_hour, "mhe")
        self.noise = process_noise(setup, self.coordinates, self.layout, drift, state_noise)
        std = np.sqrt(np.diag(self.noise))
        self._horizon = MovingHorizon(setup, self.coordinates, self.layout, self.rows, np.diag(std)[:, std > 0], solver)
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._p = setup.model.parameter_values
        self._step = FastCall(arrival_step(setup, self.coordinates, self.layout), matrices=("P", "Q", "P_next"))

    def init(self, prior: Prior) -> MheState:
        """Start from a prior with an empty window; without a joint covariance the state is taken as known."""
        z, P = first_estimate(prior, self.coordinates, self.layout)
        model, rows, m = self.setup.model, self.rows, len(self.setup.outputs)
        window = HorizonWindow(
            np.full(rows, prior.time),
            np.zeros((rows, len(model.inputs))),
            np.tile(self._p, (rows, 1)),
            np.zeros((rows, m)),
            np.zeros((rows, m)),
        )
        trajectory = np.tile(z, (rows + 1, 1))
        return MheState(
            prior.time, 0, 0, z, P, P.copy(), trajectory, np.zeros((rows, z.size)), window, prior.noise_std.copy()
        )

    def update(self, state: MheState, sample: Sample) -> tuple[MheState, Estimate]:
        """Predict, compare, take the sample in, and every so often fit the window; see `Estimator.update`."""
        measured, driving, present = driving_outputs(sample, self._columns, len(self.setup.model.outputs))
        p = self._p if sample.parameters is None else np.asarray(sample.parameters, dtype=float)
        u, k = np.asarray(sample.inputs, dtype=float), state.count
        newest, weight = state.z[k], present / state.noise_std
        # the prediction does not use the sample
        _, _, prediction, spread = self._step(
            newest, newest, state.newest_covariance, self.noise, state.time, u, p, 0 * weight, driving
        )
        expected = np.sqrt(spread**2 + state.noise_std**2)
        limit = self.outlier * expected
        believed = prediction[self._columns] + np.clip(driving - prediction[self._columns], -limit, limit)
        taken = np.where(present > 0, believed, 0.0)
        z, P, _, _ = self._step(newest, newest, state.newest_covariance, self.noise, state.time, u, p, weight, taken)
        status = Status.OK if present.any() else Status.MISSING
        if not (np.isfinite(z).all() and np.isfinite(P).all() and np.isfinite(prediction).all()):
            moved, status = replace(state, time=sample.time), Status.NOT_FINITE
        else:
            moved = self._append(
                state, HorizonWindow(*(np.asarray(v) for v in (state.time, u, p, taken, weight))), z, P
            )
            moved = replace(moved, time=sample.time, since=state.since + 1)
            if moved.since >= self.every:
                moved, solved = self._solved(moved)
                status = status if solved else Status.NOT_CONVERGED
        moved, status = self._within_bounds(moved, status)
        theta, covariance = parameters_of(moved.z[moved.count], moved.newest_covariance, self.coordinates, self.layout)
        estimate = Estimate(
            time=sample.time,
            prediction=prediction,
            innovation=measured - prediction,
            innovation_std=expected,
            parameters=theta,
            covariance=covariance,
            state=moved.z[moved.count, : self.layout.nx].copy(),
            status=status,
        )
        return moved, estimate

    def _append(self, state: MheState, row: HorizonWindow, z: FloatArray, P: FloatArray) -> MheState:
        """Window with one sample more; a full one gives its oldest sample to the arrival cost."""
        mean, arrival, window, path, noise = state.mean, state.P, state.window, state.z, state.w
        k = state.count
        if k == self.rows:
            mean, arrival = self._advance(mean, arrival, path[0] + noise[0], window, 0)
            window = HorizonWindow(
                *(np.vstack([a[1:], a[-1:]]) if a.ndim > 1 else np.append(a[1:], a[-1]) for a in _fields(window))
            )
            path, noise = np.vstack([path[1:], path[-1:]]), np.vstack([noise[1:], 0 * noise[-1:]])
            k -= 1
        fields = [a.copy() for a in _fields(window)]
        for a, value in zip(fields, _fields(row), strict=True):
            a[k:] = value  # what is not there yet looks like the newest sample, without weight
        fields[-1][k + 1 :] = 0.0
        path = path.copy()
        path[k + 1 :] = z
        return replace(
            state,
            count=k + 1,
            mean=mean,
            P=arrival,
            newest_covariance=P,
            z=path,
            w=noise,
            window=HorizonWindow(*fields),
        )

    def _advance(
        self, mean: FloatArray, P: FloatArray, s: FloatArray, window: HorizonWindow, k: int
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and covariance one interval on, linearised at s."""
        mean, P, _, _ = self._step(
            s,
            mean,
            P,
            self.noise,
            window.time[k],
            window.inputs[k],
            window.parameters[k],
            window.weight[k],
            window.measured[k],
        )
        return mean, P

    def _solved(self, state: MheState) -> tuple[MheState, bool]:
        """Fit the window; its covariance is that of the filter along it."""
        sizes, directions = np.linalg.eigh(state.P)
        factor = directions * np.sqrt(np.maximum(sizes, 0.0))
        solution = self._horizon.solve(state.window, state.mean, factor, state.z, state.w)
        if not solution.valid:
            return replace(state, since=0), False
        mean, P = state.mean, state.P
        for k in range(state.count):
            mean, P = self._advance(mean, P, solution.z[k] + solution.w[k], state.window, k)
        if not np.isfinite(P).all():
            return replace(state, since=0), False
        z, w = solution.z.copy(), solution.w.copy()
        z[state.count + 1 :], w[state.count :] = z[state.count], 0.0
        return replace(state, since=0, newest_covariance=P, z=z, w=w), True

    def _within_bounds(self, state: MheState, status: Status) -> tuple[MheState, Status]:
        """A Kalman step knows no bounds, and a solver keeps them to its tolerance only."""
        c = state.z[state.count :, self.layout.coordinates]
        inside = np.clip(c, self.coordinates.lower, self.coordinates.upper)
        if (inside == c).all():
            return state, status
        far = np.abs(inside - c).max() > 1e-6
        z = state.z.copy()
        z[state.count :, self.layout.coordinates] = inside
        return replace(state, z=z), Status.PROJECTED if far and status is Status.OK else status


def _fields(window: HorizonWindow) -> tuple[FloatArray, ...]:
    return window.time, window.inputs, window.parameters, window.measured, window.weight
