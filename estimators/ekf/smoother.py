"""Smoothing of a recorded run: the joint Kalman filter forward, then back, so that every estimate knows all samples.

The result is that of Rauch, Tung & Striebel (1965), computed without inverting a covariance, which is singular here as
soon as a state is known exactly: the adjoint of Bierman, *Fixed interval smoothing with discrete measurements*,
International Journal of Control 18 (1973). With z the filter's estimate before a sample and P its covariance,
the estimate from all samples is z + P lambda with the covariance P - P Lambda P, where, going back over a sample::

    lambda = H' e / S + (I - K H)' F' lambda,     Lambda = H' H / S + (I - K H)' F' Lambda F (I - K H)

On a nonlinear model it is linearised where the filter was (the extended smoother).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Prior, Sample, Setup, Status
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.ekf.estimator import Ekf
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import Layout, linearise_interval, parameters_of
from estimators.shared.measured import driving_outputs


@dataclass(frozen=True)
class Smoothed:
    """Estimates from all samples, at the time of each (N rows).

    Attributes
    ----------
    time
        Time of the samples [s] (N,).
    states
        Model states (N, nx).
    parameters
        Adapted parameters (N, q), within their bounds.
    covariance
        Their covariance (N, q, q), each in its unit.
    """

    time: FloatArray
    states: FloatArray
    parameters: FloatArray
    covariance: FloatArray


def smooth(estimator: Ekf, prior: Prior, samples: Sequence[Sample]) -> Smoothed:
    """Smooth a record with the model, noise and drift of a joint filter.

    A sample at which the filter could not go on (`Status.NOT_FINITE`) holds the estimate; nothing is learned from what
    comes after it about what was before. Innovations beyond `outlier_std` count as cut back to it.

    Parameters
    ----------
    estimator
        The filter.
    prior
        Where it starts.
    samples
        The record, delayed values in their places (`adaptive_flot.contracts.delayed_measurements.in_time`).
    """
    setup = estimator.setup
    names = setup.parameters, setup.outputs
    step = setup.model.derived(_backward_step, setup.dt, *names, estimator.layout, estimator.outlier_std)
    back = FastCall(step, matrices=("P", "Q", "L", "L_before"))
    states = [estimator.init(prior)]
    lost = []
    for sample in samples:
        state, estimate = estimator.update(states[-1], sample)
        states.append(state)
        lost.append(estimate.status is Status.NOT_FINITE)
    n = estimator.layout.size
    slope, curvature = np.zeros(n), np.zeros((n, n))
    rows = []
    for k in range(len(samples), 0, -1):
        state, sample = states[k], samples[k - 1]
        z = state.z + state.P @ slope
        P = state.P - state.P @ curvature @ state.P
        rows.append((z, (P + P.T) / 2))
        if lost[k - 1]:
            slope, curvature = np.zeros(n), np.zeros((n, n))
            continue
        before = states[k - 1]
        _, driving, present = driving_outputs(sample, estimator.columns, len(estimator.setup.model.outputs))
        p = estimator.setup.model.parameter_values if sample.parameters is None else sample.parameters
        slope, curvature = back(
            before.z,
            before.P,
            estimator.noise,
            before.time,
            sample.inputs,
            p,
            before.noise_std,
            driving,
            present,
            slope,
            curvature,
        )
    rows.reverse()
    return _result(estimator, samples, rows)


def _result(estimator: Ekf, samples: Sequence[Sample], rows: list[tuple[FloatArray, FloatArray]]) -> Smoothed:
    nx, q = estimator.layout.nx, estimator.layout.q
    smoothed = [parameters_of(z, P, estimator.coordinates, estimator.layout) for z, P in rows]
    return Smoothed(
        np.array([s.time for s in samples]),
        np.array([z[:nx] for z, _ in rows]).reshape(len(rows), nx),
        np.array([theta for theta, _ in smoothed]).reshape(len(rows), q),
        np.array([covariance for _, covariance in smoothed]).reshape(len(rows), q, q),
    )


def _backward_step(
    model: Model, dt: float, parameters: tuple[str, ...], outputs: tuple[str, ...], shape: Layout, outlier: float
) -> ca.Function:
    """`(z, P, Q, t, u, p, noise, measured, present, l (n,), L (n, n)) -> (l, L)` before the sample."""
    setup = Setup(model, dt, parameters, outputs)
    interval = linearise_interval(setup, Coordinates.of(model, parameters), shape)
    rows = model.indices("outputs", outputs)
    n, m = shape.size, len(rows)
    P, Q, L = (ca.SX.sym(name, n, n) for name in ("P", "Q", "L"))
    noise, measured, present = (ca.SX.sym(name, m) for name in ("noise", "measured", "present"))
    slope = ca.SX.sym("l", n)
    H, residual = interval.H[rows, :], measured - interval.outputs[rows]
    # forward over the outputs of the sample, as the filter took them
    moved, corrected, taken = ca.SX(n, 1), P + Q, []
    for j in range(m):
        row = H[j, :]
        across = corrected @ row.T
        variance = row @ across + noise[j] ** 2
        error, limit = residual[j] - row @ moved, outlier * ca.sqrt(variance)
        if np.isfinite(outlier):
            error = ca.fmin(ca.fmax(error, -limit), limit)
        gain = present[j] * across / variance
        moved = moved + gain * error
        corrected = corrected - gain @ across.T
        taken.append((row, gain, present[j] * error / variance, present[j] / variance))
    before, curvature = interval.F.T @ slope, interval.F.T @ L @ interval.F
    for row, gain, weighted, weight in reversed(taken):
        passed = ca.SX.eye(n) - gain @ row
        before = row.T * weighted + passed.T @ before
        curvature = weight * row.T @ row + passed.T @ curvature @ passed
    arguments = [interval.z, P, Q, interval.t, interval.u, interval.p, noise, measured, present, slope, L]
    names = ["z", "P", "Q", "t", "u", "p", "noise", "measured", "present", "l", "L"]
    results = [before, (curvature + curvature.T) / 2]
    return ca.Function("backward_step", arguments, results, names, ["l_before", "L_before"], {"cse": True})
