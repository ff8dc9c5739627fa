"""Prediction over one interval from the newest estimate, and its derivatives at a lagged one.

Where the outputs hardly tell two parameters apart, the direction in which they compensate turns with the point of
linearisation. A filter that linearises at every new estimate then takes the turning for information about that
direction, and its covariance becomes too small (n and C of the cell: a region that holds the truth a quarter of the
time). With the derivatives of all intervals at nearly the same parameters there is nothing to turn.

Source: first-estimates Jacobians, Huang, Mourikis & Roumeliotis, International Journal of Robotics Research 29 (2010)
502. Here the point is not the first estimate but follows the newest one slowly, since parameters drift.
"""

from __future__ import annotations

import casadi as ca

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import Layout


def lagged_interval(setup: Setup, shape: Layout) -> ca.Function:
    """Build the function for z = (x, c, v), n entries.

    Returns
    -------
    casadi.Function
        `(z (n,), c_lagged (q,), t, u (nu,), p (np,)) -> (end (n,), outputs (ny,), F (n, n), H (ny, n))`: prediction at
        z, derivatives of end and outputs for z at the parameters `c_lagged`.
    """
    return setup.model.derived(_lagged_interval, setup.dt, setup.parameters, shape)


def _lagged_interval(model: Model, dt: float, parameters: tuple[str, ...], shape: Layout) -> ca.Function:
    jacobians = Stepper(model, dt).one_step_jacobians(parameters)
    coordinates, where = Coordinates.of(model, parameters), model.indices("parameters", parameters)
    _, t, u, p = jacobians.sx_in()
    nx, q, n = shape.nx, shape.q, shape.size
    z, lagged = ca.SX.sym("z", n), ca.SX.sym("c_lagged", q)
    moved = ca.horzcat(ca.SX.eye(q), dt * ca.SX.eye(q))
    c = moved @ z[nx:]
    now, then = ca.SX(p), ca.SX(p)
    now[where], _ = coordinates.symbolic(c)
    then[where], slopes = coordinates.symbolic(lagged)
    x_next, y = jacobians(z[:nx], t, u, now)[:2]
    dx_dx, dx_dtheta, dy_dx, dy_dtheta = jacobians(z[:nx], t, u, then)[2:]
    by_c = ca.diag(slopes) @ moved
    F = ca.vertcat(
        ca.horzcat(dx_dx, dx_dtheta @ by_c), ca.horzcat(ca.SX(q, nx), moved), ca.horzcat(ca.SX(q, nx + q), ca.SX.eye(q))
    )
    H = ca.horzcat(dy_dx, dy_dtheta @ by_c)
    return ca.Function(
        "lagged_interval",
        [z, lagged, t, u, p],
        [ca.vertcat(x_next, c, z[nx + q :]), y, F, H],
        ["z", "c_lagged", "t", "u", "p"],
        ["end", "outputs", "F", "H"],
        {"cse": True},
    )
