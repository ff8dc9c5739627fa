"""Posterior Cramer-Rao bound of states and drifting parameters along a known trajectory.

z = (x, theta, d): nx model states, q parameters, and d, the move of each parameter an interval. At the start of
interval k each move is kept or renewed, and added to its parameter::

    d_k = keep_k d_(k-1) + v_k, v_k ~ N(0, V_k)     theta_k = theta_(k-1) + d_k     x_(k+1) = f(x_k, theta_k)
    y_(k+1) = g(x_k, theta_k) + e,  e ~ N(0, R)

A random walk renews every move, a ramp only at its two ends.

The bound is the inverse of the information J that no estimator exceeds: E[(estimate - z)(estimate - z)'] >= J^-1.
With the blocks D11, D12, D21 and D22 of expected second derivatives of -log p(z_(k+1), y_(k+1) | z_k)::

    J_(k+1) = D22 - D21 (J_k + D11)^-1 D12

(Tichavsky, Muravchik & Nehorai, *Posterior Cramer-Rao bounds for discrete-time nonlinear filtering*, IEEE Trans. Signal
Processing 46 (1998), equation 21). The states have no noise of their own, so D11 is infinite. The recursion is
therefore taken for P = J^-1, by the matrix inversion lemma, with the model linearised at the true trajectory::

    P_k   <- P_k - P_k H' (H P_k H' + R)^-1 H P_k     (measurements, one output after the other)
    P_k+1  = F P_k F' + V                             (one interval)

The expectation over trajectories is replaced by the trajectory at hand. Average the covariances of several runs where
that matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.rows import over_rows
from adaptive_flot.greybox.stepping.step_functions import Interval, one_step_jacobians
from adaptive_flot.greybox.stepping.stepper import Stepper

CHUNK = 500
"""Intervals that are linearised in one call."""
SAME_MOVE = 1e-6
"""Moves that differ by less, as a share of the largest, are one ramp."""


@dataclass(frozen=True)
class LinearisedTrajectory:
    """Exact derivatives of N intervals for the states and the q parameters at their start.

    Attributes
    ----------
    F
        Those of the states at the end of each interval (N, nx, nx + q).
    H
        Those of the outputs at the end of each interval (N, ny, nx + q).
    """

    F: FloatArray
    H: FloatArray


@dataclass(frozen=True)
class ParameterDrift:
    """How q parameters may move in N intervals.

    Attributes
    ----------
    keep
        1 where a parameter keeps the move of the interval before, 0 where it loses it (N, q).
    variance
        Variance of what is added to the move (N, q), in the square of the parameter's unit.
    """

    keep: FloatArray
    variance: FloatArray


def linearise_trajectory(
    stepper: Stepper, wrt: Sequence[str], x0: FloatArray, inputs: FloatArray, parameters: FloatArray, t0: float = 0.0
) -> LinearisedTrajectory:
    """Linearise N intervals of a trajectory, exactly for the step itself.

    Parameters
    ----------
    stepper
        The fast step of the model.
    wrt
        Names of the q parameters.
    x0
        State at t0 [s] (nx,).
    inputs, parameters
        True inputs (N, nu) and parameters (N, np) of each interval.
    t0
        Time at the start [s].
    """
    run = stepper.simulate(x0, inputs, parameters, t0)
    before = np.vstack([x0, run.states[:-1]])
    model, dt, rows = stepper.model, stepper.dt, len(inputs)
    jacobians = model.derived(_jacobians_of_rows, stepper.interval, tuple(wrt))
    nx, ny, q = len(model.states), len(model.outputs), len(wrt)
    F, H = np.empty((rows, nx, nx + q)), np.empty((rows, ny, nx + q))
    time = t0 + dt * np.arange(rows)
    for first in range(0, rows, CHUNK):
        part = np.minimum(np.arange(first, first + CHUNK), rows - 1)  # the last call repeats its last row
        results = jacobians(before[part].T, time[part], inputs[part].T, parameters[part].T)
        blocks = [_rows(np.array(results[i]), CHUNK)[: rows - first] for i in range(2, 6)]
        F[first : first + CHUNK] = np.concatenate(blocks[:2], axis=2)
        H[first : first + CHUNK] = np.concatenate(blocks[2:], axis=2)
    return LinearisedTrajectory(F, H)


def _jacobians_of_rows(model: Model, interval: Interval, wrt: tuple[str, ...]) -> ca.Function:
    return over_rows(one_step_jacobians(model, interval, wrt), CHUNK)


def _rows(side_by_side: FloatArray, count: int) -> FloatArray:
    """Split matrices (a, count b) into (count, a, b)."""
    return side_by_side.reshape(len(side_by_side), count, -1).transpose(1, 0, 2)


def drift_of_time_profile(theta: FloatArray) -> ParameterDrift:
    """Drift of parameters whose true time profile (N, q) is known: the times of its turns are told, not where to.

    Wherever the move from one interval to the next changes, the new move is unknown. Its standard deviation is the root
    mean square of all moves that this parameter begins in the record; a rest is known to be one.
    """
    moves = np.diff(theta, axis=0, prepend=theta[:1])
    largest = np.abs(moves).max(axis=0)
    turns = np.abs(np.diff(moves, axis=0, prepend=0.0)) > SAME_MOVE * largest
    started = turns & (np.abs(moves) > SAME_MOVE * largest)
    count = np.maximum(started.sum(axis=0), 1)
    variance = np.where(started, (np.where(started, moves, 0.0) ** 2).sum(axis=0) / count, 0.0)
    return ParameterDrift((~turns).astype(float), variance)


def random_walk(rows: int, std: FloatArray) -> ParameterDrift:
    """Drift of parameters that do a random walk over so many rows; std of each one's move an interval (q,)."""
    return ParameterDrift(np.zeros((rows, std.size)), np.tile(std**2, (rows, 1)))


def posterior_cramer_rao_bound(
    linear: LinearisedTrajectory, drift: ParameterDrift, noise_std: FloatArray, start: FloatArray
) -> FloatArray:
    """Smallest error covariance of states and parameters at the end of each interval (N, nx + q, nx + q).

    Equation 21 of Tichavsky et al. (1998) in its covariance form; see the module. Several trajectories or sets of
    sensors are bounded in one pass: each argument may have leading axes, which are broadcast, and so has the result.

    Parameters
    ----------
    linear
        The linearised trajectory.
    drift
        How the parameters may move.
    noise_std
        Standard deviation of the noise of each output at the end of each interval (N, ny); NaN where not measured.
    start
        Covariance of states and parameters before the first interval (nx + q, nx + q).
    """
    nx, size = linear.F.shape[-2:]
    move, added = _moves(drift, nx)
    passed = np.zeros((*linear.F.shape[:-2], size + drift.keep.shape[-1], size + drift.keep.shape[-1]))
    passed[..., :nx, :size] = linear.F
    passed[..., nx:, nx:] = np.eye(passed.shape[-1] - nx)
    variance = np.where(np.isfinite(noise_std), noise_std, np.inf) ** 2
    known = _after_measurements(move, added, passed, linear.H, variance, start)
    across = passed[..., :size, :]
    bounds: FloatArray = across @ known @ across.swapaxes(-1, -2)
    return (bounds + bounds.swapaxes(-1, -2)) / 2


def _moves(drift: ParameterDrift, nx: int) -> tuple[FloatArray, FloatArray]:
    """What the moves at the start of each interval do to z (N, nz, nz), and the covariance (N, nz, nz) they add."""
    q = drift.keep.shape[-1]
    first, second, renewed = (np.arange(nx, nx + q), np.arange(nx + q, nx + 2 * q), drift.variance)
    move = np.zeros((*drift.keep.shape[:-1], nx + 2 * q, nx + 2 * q))
    move[..., np.arange(nx + q), np.arange(nx + q)] = 1.0
    added = np.zeros_like(move)
    for i in (first, second):
        move[..., i, second] = drift.keep
        for j in (first, second):
            added[..., i, j] = renewed
    return move, added


def _after_measurements(
    move: FloatArray, added: FloatArray, passed: FloatArray, H: FloatArray, variance: FloatArray, start: FloatArray
) -> FloatArray:
    """Covariance of z (N, nz, nz) when the outputs of each interval are known, before it has passed."""
    rows, nz = passed.shape[-3], passed.shape[-1]
    size = H.shape[-1]
    leading = np.broadcast_shapes(passed.shape[:-3], move.shape[:-3], variance.shape[:-2], start.shape[:-2])
    P = np.zeros((*leading, nz, nz))
    P[..., :size, :size] = start
    outputs = np.zeros((*H.shape[:-1], nz))
    outputs[..., :size] = H
    first = np.broadcast_to(np.eye(nz), passed[..., :1, :, :].shape)
    step = move @ np.concatenate([first, passed[..., :-1, :, :]], axis=-3)
    of_any = np.asarray(np.isfinite(variance).reshape(-1, rows, variance.shape[-1]).any(axis=0))
    known = np.empty((*leading, rows, nz, nz))
    for k in range(rows):
        P = step[..., k, :, :] @ P @ step[..., k, :, :].swapaxes(-1, -2) + added[..., k, :, :]
        for j in np.flatnonzero(of_any[k]):
            h = outputs[..., k, j, :]
            spread = (P @ h[..., None])[..., 0]
            gain = spread / ((h * spread).sum(axis=-1) + variance[..., k, j])[..., None]
            P = P - spread[..., :, None] * gain[..., None, :]
        known[..., k, :, :] = P = (P + P.swapaxes(-1, -2)) / 2
    return known


def model_scale(model: Model, wrt: Sequence[str]) -> FloatArray:
    """Scale of each named parameter (q,): the standard deviation with which nothing is known of it."""
    return np.array(
        [model.parameters[i].prior_std or model.parameters[i].scale for i in model.indices("parameters", wrt)]
    )
