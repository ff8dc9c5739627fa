"""One update of RPEM as a compiled function: prediction, gradient, forgetting, (lupdate), (thetaupdate), projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper

Gradient = Literal["exact", "central", "recursive"]
CENTRAL_STEP = 1e-4
"""Step of the printed central differences, relative to each parameter's scale."""


@dataclass(frozen=True)
class UpdateOptions:
    """What the update does.

    Attributes
    ----------
    forgetting
        Forgetting factor lambda.
    gradient
        How psi is found.
    alternative
        Covariance that is forgotten to (q, q); None forgets exponentially, to no knowledge at all.
    correcting
        Names of the c outputs that correct the state.
    freezing
        Whether directions of the parameters may be held.
    """

    forgetting: float
    gradient: Gradient
    alternative: FloatArray | None = None
    correcting: tuple[str, ...] = ()
    freezing: bool = False


def update_function(setup: Setup, options: UpdateOptions) -> ca.Function:
    """Build the update.

    Returns
    -------
    casadi.Function
        `(x, t, u, p, theta, covariance, noise (m,), measured (m,), present (m,)[, S (nx, q)][, free (q, q)]
        [, gain (nx, c), reach (c,), seen (c,), there (c,)]) -> (x_next, theta_next, covariance_next, prediction,
        expected_std (m,), flags[, S_next][, information (q, q)])`. With the recursive gradient S is the sensitivity of
        the state; with freezing `free` projects the step of theta onto the directions that may move, and information is
        that of this sample; with correcting outputs `gain` moves the state by their errors, each cut at `reach`, where
        `seen` is measured and `there`. flags: a number that is finite only if the result is, the number of parameters
        that were projected onto their bounds, and of driving outputs that are there.
    """
    model = setup.model
    columns, rows = model.indices("parameters", setup.parameters), model.indices("outputs", setup.outputs)
    q, m, nx, recursive = len(columns), len(rows), len(model.states), options.gradient == "recursive"
    x, t, u, p = Stepper(model, setup.dt).step.sx_in()
    theta, cov, S, free = (ca.SX.sym(*a) for a in (("theta", q), ("covariance", q, q), ("S", nx, q), ("free", q, q)))
    noise, measured, present = (ca.SX.sym(name, m) for name in ("noise", "measured", "present"))
    p_now = ca.SX(p)
    p_now[columns] = theta

    x_next, S_next, y, slope = _prediction(setup, options.gradient)(x, S, t, u, p_now)
    psi = slope[rows, :] / ca.repmat(noise, 1, q)
    residual, some = (measured - y[rows]) / noise, ca.sum1(present)
    forgotten = _forget(cov, some > 0, options)
    expected = [noise[j] * ca.sqrt(1 + psi[j, :] @ forgotten @ psi[j, :].T) for j in range(m)]
    theta_next, updated = _correct(theta, forgotten, psi, residual, present, free if options.freezing else None)
    lower, upper = (ca.DM([getattr(model.parameters[i], bound) for i in columns]) for bound in ("lower", "upper"))
    inside = ca.fmin(ca.fmax(theta_next, lower), upper)
    correction: list[ca.SX] = []
    if options.correcting:
        x_next, S_next, correction = _correct_state(setup, options.correcting, x_next, S_next, y, slope)
    if recursive:
        x_next += S_next @ (inside - theta)
    if options.correcting:
        x_next = _within_range(setup, x_next)

    size = ca.sumsqr(x_next) + ca.sumsqr(theta_next) + ca.sumsqr(updated) + ca.sumsqr(y[rows])
    names = ["x", "t", "u", "p", "theta", "covariance", "noise", "measured", "present"]
    arguments = [x, t, u, p, theta, cov, noise, measured, present]
    results = {
        **{"x_next": x_next, "theta_next": inside, "covariance_next": updated, "prediction": y},
        **{"expected_std": ca.vertcat(*expected), "flags": ca.vertcat(size, ca.sum1(inside != theta_next), some)},
    }
    # what is not used is not passed: an argument costs as much as a hundred operations
    if recursive:
        names, arguments = [*names, "S"], [*arguments, S]
        results["S_next"] = S_next
    if options.freezing:
        names, arguments = [*names, "free"], [*arguments, free]
        results["information"] = ca.densify(sum((present[j] * psi[j, :].T @ psi[j, :] for j in range(m)), ca.SX(q, q)))
    if options.correcting:
        names, arguments = [*names, "gain", "reach", "seen", "there"], [*arguments, *correction]
    return ca.Function("rpem_update", arguments, [*results.values()], names, [*results], {"cse": True})


def _forget(covariance: ca.SX, some: ca.SX, options: UpdateOptions) -> ca.SX:
    """L / lambda, or (lambda L^-1 + (1 - lambda) A^-1)^-1 without the inverses of what may be singular."""
    if options.alternative is None:
        return covariance / ca.if_else(some, options.forgetting, 1.0)
    A, factor = ca.SX(ca.DM(options.alternative)), options.forgetting
    forgotten = covariance @ ca.solve(factor * A + (1 - factor) * covariance, A)
    return ca.if_else(some, (forgotten + forgotten.T) / 2, covariance)


def _correct(
    theta: ca.SX,
    forgotten: ca.SX,
    psi: ca.SX,
    residual: ca.SX,
    present: ca.SX,
    free: ca.SX | None,
) -> tuple[ca.SX, ca.SX]:
    """(lupdate) and (thetaupdate) one output at a time: the same as the block form, without a matrix inverse."""
    updated, theta_next = forgotten, theta
    for j in range(residual.numel()):
        row = psi[j, :]
        gain = present[j] * (updated @ row.T) / (1 + row @ updated @ row.T)
        gain = gain if free is None else free @ gain
        theta_next = theta_next + gain * (residual[j] - row @ (theta_next - theta))
        # Joseph's form of (lupdate): the same in exact arithmetic, never indefinite in rounded one, and right for any
        # gain
        left = ca.SX.eye(theta.numel()) - gain @ row
        updated = left @ updated @ left.T + gain @ gain.T
    return theta_next, (updated + updated.T) / 2


def _correct_state(
    setup: Setup, names: Sequence[str], x: ca.SX, S: ca.SX, y: ca.SX, slope: ca.SX
) -> tuple[ca.SX, ca.SX, list[ca.SX]]:
    """State and sensitivity (nx, q) moved by the errors of c outputs, and the arguments gain, reach, seen, there."""
    rows = setup.model.indices("outputs", names)
    c, nx = len(rows), x.numel()
    gain, (reach, seen, there) = ca.SX.sym("gain", nx, c), (ca.SX.sym(name, c) for name in ("reach", "seen", "there"))
    for i, row in enumerate(rows):
        error = seen[i] - y[row]
        x += there[i] * gain[:, i] * ca.fmin(ca.fmax(error, -reach[i]), reach[i])
        S -= there[i] * (ca.fabs(error) < reach[i]) * gain[:, i] @ slope[row, :]
    return x, S, [gain, reach, seen, there]


def _within_range(setup: Setup, x: ca.SX) -> ca.SX:
    """States within their physical range: a wrong instrument must not push a mass below zero."""
    lower, upper = (ca.DM([getattr(state, bound) for state in setup.model.states]) for bound in ("lower", "upper"))
    return ca.fmin(ca.fmax(x, lower), upper)


def _prediction(setup: Setup, gradient: Gradient) -> ca.Function:
    """`(x, S, t, u, p) -> (x_next, S_next, y, dy_dtheta)`."""
    stepper = Stepper(setup.model, setup.dt)
    if gradient == "recursive":
        return stepper.sensitivity_step(setup.parameters)
    x, t, u, p = stepper.step.sx_in()
    S = ca.SX.sym("S", x.numel(), len(setup.parameters))
    if gradient == "exact":
        x_next, y, slope = stepper.one_step_gradient(setup.parameters)(x, t, u, p)
    else:
        x_next, y, _ = stepper.step(x, t, u, p)
        slope = _central(stepper, setup, (x, t, u, p))
    return ca.Function("prediction", [x, S, t, u, p], [x_next, S, y, slope])


def _central(stepper: Stepper, setup: Setup, symbols: tuple[ca.SX, ca.SX, ca.SX, ca.SX]) -> ca.SX:
    x, t, u, p = symbols
    columns = []
    for i in setup.model.indices("parameters", setup.parameters):
        move = ca.DM(p.numel(), 1)
        move[i] = CENTRAL_STEP * setup.model.parameters[i].scale
        ahead, behind = stepper.step(x, t, u, p + move)[1], stepper.step(x, t, u, p - move)[1]
        columns.append((ahead - behind) / (2 * move[i]))
    return ca.horzcat(*columns)


def alternative_covariance(setup: Setup, share: float) -> FloatArray:
    """Covariance (q, q) of parameters of which nothing is known but their size, to within a share of it."""
    parameters = [setup.model.parameters[i] for i in setup.model.indices("parameters", setup.parameters)]
    return np.diag([(share * (abs(p.value) or p.scale)) ** 2 for p in parameters])
