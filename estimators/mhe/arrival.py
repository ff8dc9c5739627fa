"""One Kalman step of z = (x, c), linearised where the window says that z was: arrival cost and covariance of an MHE."""

from __future__ import annotations

import casadi as ca

from adaptive_flot.contracts import Setup
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import Layout, linearise_interval


def arrival_step(setup: Setup, coordinates: Coordinates, shape: Layout) -> ca.Function:
    """Build the step: `joint_filter.filter_step`, with the point of linearisation s apart from the mean z.

    Source: Tenny & Rawlings, *Efficient moving horizon estimation and nonlinear model predictive control*, American
    Control Conference (2002): an arrival cost from the filter along the smoothed trajectory.

    Returns
    -------
    casadi.Function
        `(s (n,), z (n,), P (n, n), Q (n, n), t, u (nu,), p (np,), weight (m,), measured (m,)) ->
        (z_next, P_next, prediction (ny,), spread (m,))`; weight is 1 / noise and zero where nothing is measured, spread
        the standard deviation of the prediction without noise.
    """
    interval = linearise_interval(setup, coordinates, shape)
    rows = setup.model.indices("outputs", setup.outputs)
    m, n = len(rows), shape.size
    z, P, Q = ca.SX.sym("z_mean", n), ca.SX.sym("P", n, n), ca.SX.sym("Q", n, n)
    weight, measured = ca.SX.sym("weight", m), ca.SX.sym("measured", m)
    H, moved, corrected = interval.H[rows, :], z - interval.z, P + Q
    prediction = interval.outputs + interval.H @ moved
    spread = [ca.sqrt(ca.fmax(H[j, :] @ corrected @ H[j, :].T, 0)) for j in range(m)]
    for j in range(m):
        row = weight[j] * H[j, :]
        across = corrected @ row.T
        gain = across / (row @ across + 1)
        moved = moved + gain * (weight[j] * (measured[j] - interval.outputs[rows[j]]) - row @ moved)
        left = corrected - gain @ across.T
        corrected = left - (left @ row.T) @ gain.T + gain @ gain.T
    end = interval.end + interval.F @ moved
    carried = interval.F @ corrected @ interval.F.T
    return ca.Function(
        "arrival_step",
        [interval.z, z, P, Q, interval.t, interval.u, interval.p, weight, measured],
        [end, (carried + carried.T) / 2, prediction, ca.vertcat(*spread)],
        ["s", "z", "P", "Q", "t", "u", "p", "weight", "measured"],
        ["z_next", "P_next", "prediction", "spread"],
        {"cse": True},
    )
