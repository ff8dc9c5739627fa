"""One interval of the extended Kalman filter as one compiled function.

With z = (x, c), the states and the walking parameters, process noise acts at the start of an interval::

    s_k = z_k + w_k, w ~ N(0, Q)         z_{k+1} = f(s_k)         y_{k+1} = g(s_k) + e, e ~ N(0, R)

so F = df/ds and H = dg/ds are exact derivatives of the step itself. The sample corrects s one output at a time in
Joseph's form; mean and covariance are then carried through F. Bar-Shalom, Li & Kirubarajan, *Estimation with
Applications to Tracking and Navigation* (2001), sections 5.2 and 10.3.

An innovation e of variance S counts with the weight (nu + 1) / (nu + e^2 / S) of Student's t distribution with nu
degrees of freedom, and adds its log-density to the likelihood. Roth, Ozkan & Gustafsson, *IEEE ICASSP* (2013) 5770.
The covariance is that of the gain with this weight: what was hardly believed has hardly made the state known. With the
full gain's covariance, a state that is hidden behind a lag and starts far off would never be corrected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.in_steps import at_the_end
from adaptive_flot.greybox.stepping.stepper import Stepper

NAMES = ["z", "P", "t", "u", "p", "Q", "r", "y", "there"]
TOLD = ["z_next", "P_next", "ahead", "F", "H", "predicted", "variance", "log_likelihood"]


def filter_step(
    model: Model, dt: float, outputs: Sequence[int], walking: Sequence[str], nu: float, beside: Sequence[str] = ()
) -> ca.Function:
    """Build the step for m outputs and w walking parameters, n = nx + w.

    It is built from the derivatives by the parameters `beside` too, where these are asked for anyway.

    Returns
    -------
    casadi.Function
        ``(z (n,), P (n, n), t, u (nu,), p (np,), Q (n,), r (m,), y (m,), there (m,)) -> (z_next, P_next, ahead (n,),
        F (n, n), H (m, n), predicted (m,), variance (m,), log_likelihood)``. `ahead` is f(z), before the sample was
        used; predicted and variance are those of each output before its correction by any.
    """
    jacobians = Stepper(model, dt).one_step_jacobians([*walking, *beside])
    _, t, u, p = jacobians.sx_in()
    nx, w, m = len(model.states), len(walking), len(outputs)
    n, rows = nx + w, list(outputs)
    z, P = ca.SX.sym("z", n), ca.SX.sym("P", n, n)
    Q, r, y, there = ca.SX.sym("Q", n), ca.SX.sym("r", m), ca.SX.sym("y", m), ca.SX.sym("there", m)
    p_now = ca.SX(p)
    if w:
        p_now[model.indices("parameters", walking)] = z[nx:]
    walked = z[nx:] if w else ca.SX(0, 1)  # a slice beyond a vector of one is a row
    x_next, outs, fx, fp, hx, hp = jacobians(z[:nx], t, u, p_now)
    fp, hp = fp[:, :w], hp[:, :w]
    F = ca.vertcat(ca.horzcat(fx, fp), ca.horzcat(ca.SX(w, nx), ca.SX.eye(w)))
    H = ca.horzcat(hx, hp)[rows, :]
    results = _filtered(P, ca.vertcat(x_next, walked), F, H, outs[rows], (Q, r, y, there), nu)
    return ca.Function("filter_step", [z, P, t, u, p, Q, r, y, there], results, NAMES, TOLD)


def filter_after_steps(model: Model, dt: float, outputs: Sequence[int], nu: float) -> ca.Function:
    """The same after the steps of an interval (`stepping.in_steps`), for a filter without walking parameters.

    The arguments END and ALONG, what these steps leave, are between P and t.
    """
    nx, m, rows = len(model.states), len(outputs), list(outputs)
    given, names, outs, slopes = at_the_end(model, dt, ())
    z, P = ca.SX.sym("z", nx), ca.SX.sym("P", nx, nx)
    Q, r, y, there = ca.SX.sym("Q", nx), ca.SX.sym("r", m), ca.SX.sym("y", m), ca.SX.sym("there", m)
    end, along = given[:2]
    results = _filtered(P, end, along, slopes[rows, :], outs[rows], (Q, r, y, there), nu)
    names = ["z", "P", *names, "Q", "r", "y", "there"]
    return ca.Function("filter_after_steps", [z, P, *given, Q, r, y, there], results, names, TOLD, {"cse": True})


def _filtered(
    P: ca.SX, ahead: ca.SX, F: ca.SX, H: ca.SX, predicted: ca.SX, measured: tuple[ca.SX, ...], nu: float
) -> list[ca.SX]:
    """Results of an interval that leads ahead, with the derivatives F of that and H of what is predicted there."""
    Q, r, y, there = measured
    corrected = P + ca.diag(Q)
    variance = ca.vertcat(*(H[j, :] @ corrected @ H[j, :].T + r[j] ** 2 for j in range(r.numel())))
    moved, corrected, likelihood = correct(corrected, H, y - predicted, r, there, nu)
    carried = F @ corrected @ F.T
    carried = (carried + carried.T) / 2
    return [ahead + F @ moved, carried, ahead, ca.densify(F), ca.densify(H), predicted, variance, likelihood]


def first_correction(model: Model, outputs: Sequence[int], walking: Sequence[str], nu: float) -> ca.Function:
    """Correction by the first row, whose outputs are those of the initial state itself.

    Returns ``(z, P, t, u, p, r, y, there) -> (z, P, predicted, variance, log_likelihood)``.
    """
    t, _, u, p = model.ode.sx_in()
    nx, w, m = len(model.states), len(walking), len(outputs)
    z, P = ca.SX.sym("z", nx + w), ca.SX.sym("P", nx + w, nx + w)
    r, y, there = ca.SX.sym("r", m), ca.SX.sym("y", m), ca.SX.sym("there", m)
    p_now = ca.SX(p)
    if w:
        p_now[model.indices("parameters", walking)] = z[nx:]
    predicted = model.ode(t, z[:nx], u, p_now)[1][list(outputs)]
    H = ca.jacobian(predicted, z)
    variance = ca.vertcat(*(H[j, :] @ P @ H[j, :].T + r[j] ** 2 for j in range(m)))
    moved, corrected, likelihood = correct(P, H, y - predicted, r, there, nu)
    names = (
        ["z", "P", "t", "u", "p", "r", "y", "there"],
        ["z_next", "P_next", "predicted", "variance", "log_likelihood"],
    )
    results = [z + moved, corrected, predicted, variance, likelihood]
    return ca.Function("first_correction", [z, P, t, u, p, r, y, there], results, *names)


def correct(P: ca.SX, H: ca.SX, residual: ca.SX, r: ca.SX, there: ca.SX, nu: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Correct by one output after the other: move (n,), covariance (n, n) and log-likelihood."""
    n, m = P.shape[0], H.shape[0]
    moved, likelihood = ca.SX(n, 1), ca.SX(0)
    for j in range(m):
        row = H[j, :]
        spread = P @ row.T
        variance = row @ spread + r[j] ** 2
        error = residual[j] - row @ moved
        square = error**2 / variance
        weight = 1.0 if math.isinf(nu) else (nu + 1) / (nu + square)
        gain = there[j] * weight * spread / variance
        moved = moved + gain * error
        left = P - gain @ spread.T
        P = left - (left @ row.T) @ gain.T + r[j] ** 2 * gain @ gain.T
        likelihood += there[j] * _log_density(square, variance, nu)
    return moved, P, likelihood


def _log_density(square: ca.SX, variance: ca.SX, nu: float) -> ca.SX:
    """Logarithm of Student's t density (nu degrees of freedom, squared scale `variance`) at a squared distance."""
    if math.isinf(nu):
        return -(ca.log(2 * np.pi * variance) + square) / 2
    constant = math.lgamma((nu + 1) / 2) - math.lgamma(nu / 2) - math.log(nu * math.pi) / 2
    return constant - ca.log(variance) / 2 - (nu + 1) / 2 * ca.log(1 + square / nu)
