"""One update of RPEM as a compiled function: prediction, gradient, forgetting, (lupdate), (thetaupdate), projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepper import Stepper
from adaptive_flot.protocols import Setup

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
        Names of the outputs that correct the state and do not drive the parameters.
    freezing
        Whether directions of the parameters may be held.
    """

    forgetting: float
    gradient: Gradient
    alternative: FloatArray | None = None
    correcting: tuple[str, ...] = ()
    freezing: bool = False

    def driving(self, setup: Setup) -> tuple[str, ...]:
        """Names of the outputs that drive the parameters."""
        return tuple(name for name in setup.outputs if name not in self.correcting)


def update_function(setup: Setup, options: UpdateOptions) -> ca.Function:
    """Build the update.

    Returns
    -------
    casadi.Function
        `(x, t, u, p, theta, covariance, noise (m,), measured (m,), present (m,)[, S (nx, q)][, free (q, q)]
        [, gain (nx, c)]) -> (x_next, theta_next, covariance_next, prediction, expected_std (m,), flags[, S_next]
        [, information (q, q)])`. With the recursive gradient S is the sensitivity of the state; with freezing `free`
        projects the step of theta onto the directions that may move, and information is that of this sample; `gain`
        corrects the state by the c correcting outputs. flags: a number that is finite only if the result is, the
        number of parameters that were projected onto their bounds, and of driving outputs that are there.
    """
    model = setup.model
    columns = model.indices("parameters", setup.parameters)
    rows = model.indices("outputs", setup.outputs)
    drives = [setup.outputs.index(name) for name in options.driving(setup)]
    corrects = [setup.outputs.index(name) for name in options.correcting]
    q, m, nx = len(columns), len(rows), len(model.states)
    x, t, u, p = Stepper(model, setup.dt).step.sx_in()
    theta, cov, S = ca.SX.sym("theta", q), ca.SX.sym("covariance", q, q), ca.SX.sym("S", nx, q)
    noise, measured, present = ca.SX.sym("noise", m), ca.SX.sym("measured", m), ca.SX.sym("present", m)
    free, correction = ca.SX.sym("free", q, q), ca.SX.sym("gain", nx, len(corrects))
    p_now = ca.SX(p)
    p_now[columns] = theta

    x_next, S_next, y, slope = _prediction(setup, options.gradient)(x, S, t, u, p_now)
    psi = slope[rows, :] / ca.repmat(noise, 1, q)
    residual = (measured - y[rows]) / noise
    some = sum((present[j] for j in drives), ca.SX(0))
    forgotten = _forget(cov, some > 0, options)
    expected = [noise[j] * ca.sqrt(1 + psi[j, :] @ forgotten @ psi[j, :].T) for j in range(m)]
    theta_next, updated = _correct(theta, forgotten, psi, residual, present, drives, free if options.freezing else None)
    if options.gradient == "recursive":
        x_next += S_next @ (theta_next - theta)
    for i, j in enumerate(corrects):
        x_next += present[j] * correction[:, i] * (measured - y[rows])[j]
        S_next -= present[j] * correction[:, i] @ slope[rows[j], :]

    lower = ca.DM([model.parameters[i].lower for i in columns])
    upper = ca.DM([model.parameters[i].upper for i in columns])
    inside = ca.fmin(ca.fmax(theta_next, lower), upper)
    size = ca.sumsqr(x_next) + ca.sumsqr(theta_next) + ca.sumsqr(updated) + ca.sumsqr(y[rows])
    arguments = {
        **{"x": x, "t": t, "u": u, "p": p, "theta": theta, "covariance": cov},
        **{"noise": noise, "measured": measured, "present": present},
    }
    results = {
        **{"x_next": x_next, "theta_next": inside, "covariance_next": updated, "prediction": y},
        **{"expected_std": ca.vertcat(*expected), "flags": ca.vertcat(size, ca.sum1(inside != theta_next), some)},
    }
    # what is not used is not passed: an argument costs as much as a hundred operations
    if options.gradient == "recursive":
        arguments["S"], results["S_next"] = S, S_next
    if options.freezing:
        information = sum((present[j] * psi[j, :].T @ psi[j, :] for j in drives), ca.SX(q, q))
        arguments["free"], results["information"] = free, ca.densify(information)
    if corrects:
        arguments["gain"] = correction
    return ca.Function(
        "rpem_update", [*arguments.values()], [*results.values()], [*arguments], [*results], {"cse": True}
    )


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
    drives: Sequence[int],
    free: ca.SX | None,
) -> tuple[ca.SX, ca.SX]:
    """(lupdate) and (thetaupdate) one output at a time: the same as the block form, without a matrix inverse."""
    updated, theta_next = forgotten, theta
    for j in drives:
        row = psi[j, :]
        gain = present[j] * (updated @ row.T) / (1 + row @ updated @ row.T)
        gain = gain if free is None else free @ gain
        theta_next = theta_next + gain * (residual[j] - row @ (theta_next - theta))
        # Joseph's form of (lupdate): the same in exact arithmetic, never indefinite in rounded one, and right for any
        # gain
        left = ca.SX.eye(theta.numel()) - gain @ row
        updated = left @ updated @ left.T + gain @ gain.T
    return theta_next, (updated + updated.T) / 2


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
