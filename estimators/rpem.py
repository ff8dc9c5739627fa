"""Recursive prediction error method, as in Gonzalez & Quintanilla, equations (thetaupdate) and (lupdate)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.fastcall import FastCall
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepper import Stepper
from adaptive_flot.protocols import Estimate, Prior, Sample, Setup, Status

Gradient = Literal["exact", "central"]
CENTRAL_STEP = 1e-4
"""Step of the printed central differences, relative to each parameter's scale."""


@dataclass(frozen=True)
class RpemState:
    """What the next step needs.

    Attributes
    ----------
    time
        Time of the model state [s].
    x
        Model state (nx,), predicted with the newest estimate.
    theta
        Estimate (q,).
    covariance
        sigma^2 L (q, q): the paper's inverse Hessian L times the noise variance.
    noise_std
        sigma of each driving output (m,).
    """

    time: float
    x: FloatArray
    theta: FloatArray
    covariance: FloatArray
    noise_std: FloatArray


class Rpem:
    """Tracks parameters by a Gauss-Newton step a sample with exponential forgetting.

    With eta_N the output residual of the one-step prediction from the previous state with the newest estimate, and
    psi_N its derivative for that state held::

        L_N     = (L_{N-1} - L_{N-1} psi_N (lambda + psi_N' L_{N-1} psi_N)^-1 psi_N' L_{N-1}) / lambda     (lupdate)
        theta_N = theta_{N-1} + L_N psi_N eta_N                                                        (thetaupdate)

    Outputs are divided by their noise standard deviation, so that sigma^2 L, the covariance, takes the place of L; for
    one output this changes nothing in theta, for several it weighs them. A missing output leaves its term out; when
    all are missing nothing is forgotten.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and driving outputs (m).
    forgetting
        Forgetting factor lambda in (0, 1]; 1 / (1 - lambda) samples is the memory.
    gradient
        `exact`: forward sensitivities of the step; `central`: second-order central differences, four more simulations
        a sample, as the paper prints.
    l0_scale
        Factor on the prior covariance ("L_0 is chosen proportional to the empirical covariance").

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self, setup: Setup, *, forgetting: float = 0.995, gradient: Gradient = "exact", l0_scale: float = 1.0
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise ModelError(f"rpem: forgetting = {forgetting:g}; give a factor in (0, 1], for example 0.995")
        if gradient not in ("exact", "central"):
            raise ModelError(f"rpem: unknown gradient {gradient!r}; {near_match(gradient, ['exact', 'central'])}")
        if not l0_scale > 0.0:
            raise ModelError(f"rpem: l0_scale = {l0_scale:g}; give a positive factor")
        self.setup = setup
        self.forgetting = forgetting
        self.gradient = gradient
        self.l0_scale = l0_scale
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._shape = (len(setup.model.outputs),)
        self._p = setup.model.parameter_values
        self._update = FastCall(
            _update_function(setup, forgetting, gradient),
            matrices=("covariance", "covariance_next"),
            as_machine_code=setup.model.compiled,
        )

    def init(self, prior: Prior) -> RpemState:
        """Start from a prior, L_0 from its covariance."""
        return RpemState(
            prior.time,
            prior.state.copy(),
            prior.parameters.copy(),
            self.l0_scale * prior.covariance,
            prior.noise_std.copy(),
        )

    def update(self, state: RpemState, sample: Sample) -> tuple[RpemState, Estimate]:
        """Predict, compare, correct; see `Estimator.update`."""
        measured = np.asarray(sample.outputs, dtype=float)
        if measured.shape != self._shape:
            raise ModelError(f"a sample has {measured.shape} outputs, the model {self._shape}")
        driving = measured[self._columns]
        present = np.isfinite(driving)
        count = np.count_nonzero(present)
        x, theta, covariance, prediction, expected_std, flags = self._update(
            state.x,
            state.time,
            sample.inputs,
            self._p if sample.parameters is None else sample.parameters,
            state.theta,
            state.covariance,
            state.noise_std,
            driving if count == present.size else np.where(present, driving, 0.0),
            present,
        )
        status = Status.OK if count else Status.MISSING
        if not math.isfinite(flags[0]):
            x, theta, covariance, status = state.x, state.theta, state.covariance, Status.NOT_FINITE
        elif flags[1] > 0:
            status = Status.PROJECTED
        new = RpemState(sample.time, x, theta, covariance, state.noise_std)
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


def _update_function(setup: Setup, forgetting: float, gradient: Gradient) -> ca.Function:
    """One whole update as a CasADi function: prediction, gradient, (lupdate), (thetaupdate), projection."""
    model = setup.model
    columns = model.indices("parameters", setup.parameters)
    rows = model.indices("outputs", setup.outputs)
    q, m = len(columns), len(rows)
    x, t, u, p = Stepper(model, setup.dt).step.sx_in()
    theta, cov = ca.SX.sym("theta", q), ca.SX.sym("covariance", q, q)
    noise, measured, present = ca.SX.sym("noise", m), ca.SX.sym("measured", m), ca.SX.sym("present", m)
    p_now = ca.SX(p)
    p_now[columns] = theta

    x_next, y, psi = _prediction(setup, gradient)(x, t, u, p_now)
    psi = psi[rows, :] / ca.repmat(noise, 1, q)
    residual = (measured - y[rows]) / noise

    # (lupdate) and (thetaupdate) one output at a time: the same as the block form, without a matrix inverse
    forgotten = cov / ca.if_else(ca.sum1(present) > 0, forgetting, 1.0)
    expected = [noise[j] * ca.sqrt(1 + psi[j, :] @ forgotten @ psi[j, :].T) for j in range(m)]
    updated = forgotten
    theta_next = theta
    for j in range(m):
        row = psi[j, :]
        gain = present[j] * (updated @ row.T) / (1 + row @ updated @ row.T)
        theta_next = theta_next + gain * (residual[j] - row @ (theta_next - theta))
        # Joseph's form of (lupdate): the same in exact arithmetic, and never indefinite in rounded one
        left = ca.SX.eye(q) - gain @ row
        updated = left @ updated @ left.T + gain @ gain.T
    updated = (updated + updated.T) / 2

    lower = ca.DM([model.parameters[i].lower for i in columns])
    upper = ca.DM([model.parameters[i].upper for i in columns])
    inside = ca.fmin(ca.fmax(theta_next, lower), upper)
    # one number that is finite only if the whole new state is, and the number of parameters that were projected
    size = ca.sumsqr(x_next) + ca.sumsqr(theta_next) + ca.sumsqr(updated) + ca.sumsqr(y[rows])
    flags = ca.vertcat(size, ca.sum1(inside != theta_next))
    return ca.Function(
        "rpem_update",
        [x, t, u, p, theta, cov, noise, measured, present],
        [x_next, inside, updated, y, ca.vertcat(*expected), flags],
        ["x", "t", "u", "p", "theta", "covariance", "noise", "measured", "present"],
        ["x_next", "theta_next", "covariance_next", "prediction", "expected_std", "flags"],
        {"cse": True},
    )


def _prediction(setup: Setup, gradient: Gradient) -> ca.Function:
    """`(x, t, u, p) -> (x_next, y, dy_dtheta)`."""
    stepper = Stepper(setup.model, setup.dt)
    if gradient == "exact":
        return stepper.one_step_gradient(setup.parameters)
    x, t, u, p = stepper.step.sx_in()
    x_next, y, _ = stepper.step(x, t, u, p)
    psi = []
    for i in setup.model.indices("parameters", setup.parameters):
        move = ca.DM(p.numel(), 1)
        move[i] = CENTRAL_STEP * setup.model.parameters[i].scale
        ahead, behind = stepper.step(x, t, u, p + move)[1], stepper.step(x, t, u, p - move)[1]
        psi.append((ahead - behind) / (2 * move[i]))
    return ca.Function("central", [x, t, u, p], [x_next, y, ca.horzcat(*psi)])
