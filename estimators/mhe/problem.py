"""The nonlinear program of a moving horizon: unknowns, cost and dynamics of one window, in stage order.

Notation, as in `joint_filter.py`: z = (x, c) model state and parameter coordinates; w noise at the start of an
interval; s = z + w; z+ = f(s), y = g(s) + e. With w = B omega, B B' = Q and z_0 = mean + L xi, L L' = P (the arrival
cost), all unknowns omega and xi have unit variance, and a direction without any (a state known exactly) is no unknown::

    min |xi|^2 + sum_k |omega_k|^2 + sum_k |(y_k - g(z_k + B omega_k)) / noise|^2
    subject to z_(k+1) = f(z_k + B omega_k), lower <= c_k <= upper

Source: Rao, Rawlings & Lee, Automatica 37 (2001) (linear); Rao, Rawlings & Mayne, IEEE Trans. Automatic Control 48
(2003). The Hessian given to Ipopt is that of Gauss-Newton, the dynamics entering as constraints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import Layout

SOLVERS = ("ipopt", "fatrop")
MOST_ITERATIONS = 50
TOLERANCE = 1e-8


@dataclass(frozen=True)
class HorizonWindow:
    """Data of N intervals: start (N,), inputs (N, nu), parameters (N, np), driving outputs (N, m), 1 / noise (N, m)."""

    time: FloatArray
    inputs: FloatArray
    parameters: FloatArray
    measured: FloatArray
    weight: FloatArray


@dataclass(frozen=True)
class HorizonSolution:
    """Trajectory z (N + 1, n), noise w (N, n), and whether the solver came to an end that satisfies its equations."""

    z: FloatArray
    w: FloatArray
    valid: bool


class MovingHorizon:
    """The program of N intervals, compiled once for all windows.

    Parameters
    ----------
    setup, coordinates, shape
        What z is; the walk is not integrated.
    rows
        Number of intervals N.
    noise
        Factor B (n, r) of the process noise of an interval.
    solver
        `ipopt` with the Gauss-Newton Hessian, or `fatrop` with the exact one.
    """

    def __init__(
        self, setup: Setup, coordinates: Coordinates, shape: Layout, rows: int, noise: FloatArray, solver: str
    ) -> None:
        n, self._r = noise.shape
        self._rows, self._n, self._noise = rows, n, noise
        states = [q.scale for q in setup.model.states]
        self._scale = np.concatenate([states, coordinates.scale])
        gap, residual, slopes = _interval(setup, coordinates, self._scale, noise)
        nu, npar, m = len(setup.model.inputs), len(setup.model.parameters), len(setup.outputs)
        x = [ca.MX.sym(f"x{k}", n) for k in range(rows + 1)]
        u = [ca.MX.sym(f"u{k}", self._r + (n if k == 0 else 0)) for k in range(rows)]
        data = ca.MX.sym("data", 1 + nu + npar + 2 * m, rows)
        mean, factor = ca.MX.sym("mean", n), ca.MX.sym("factor", n, n)
        omega, xi = [part[: self._r] for part in u], u[0][self._r :]
        starts, drives = ca.horzcat(*x[:-1]), ca.horzcat(*omega)
        ends = gap.map(rows)(starts, drives, data)
        errors = residual.map(rows)(starts, drives, data)
        # stage order: the gap of a stage, then its own equations
        g = [x[1] - ends[:, 0], x[0] - (mean + factor @ xi) / self._scale]
        g += [x[k + 1] - ends[:, k] for k in range(1, rows)]
        order = [part for k in range(rows) for part in (x[k], u[k])] + [x[rows]]
        unknowns = ca.vertcat(*order)
        p = ca.vertcat(ca.vec(data), mean, ca.vec(factor))
        f = ca.sumsqr(errors) + ca.sumsqr(drives) + ca.sumsqr(xi)
        nlp = {"x": unknowns, "p": p, "f": f, "g": ca.vertcat(*g)}
        options: dict[str, Any] = {"print_time": False, "error_on_fail": False}
        if solver == "ipopt":
            rows_of = slopes.map(rows)(starts, drives, data)
            blocks = _gauss_newton(rows_of, rows, n, self._r)
            options |= {"hess_lag": _hessian(unknowns, p, len(g), n, blocks)}
            options |= {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": TOLERANCE}
            options |= {"ipopt.max_iter": MOST_ITERATIONS, "ipopt.mu_init": 1e-6, "ipopt.bound_push": 1e-9}
        else:
            options |= {"structure_detection": "auto", "equality": [True] * (len(g) * n), "fatrop.print_level": 0}
            options |= {"fatrop.tol": TOLERANCE, "fatrop.max_iter": MOST_ITERATIONS, "fatrop.mu_init": 1e-6}
        self._solve = ca.nlpsol("mhe", solver, nlp, options)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        low[shape.coordinates], high[shape.coordinates] = coordinates.lower, coordinates.upper
        self._lower, self._upper = (
            self._packed(np.tile(z, (rows + 1, 1)), np.full((rows, self._r), free), np.full(n, free))
            for z, free in ((low, -np.inf), (high, np.inf))
        )

    def _packed(self, z: FloatArray, omega: FloatArray, xi: FloatArray) -> FloatArray:
        """Unknowns in stage order."""
        parts = []
        for k in range(self._rows):
            parts += [z[k] / self._scale, omega[k]] + ([xi] if k == 0 else [])
        return np.concatenate([*parts, z[-1] / self._scale])

    def solve(
        self, window: HorizonWindow, mean: FloatArray, factor: FloatArray, z: FloatArray, w: FloatArray
    ) -> HorizonSolution:
        """Most likely trajectory of a window, from a guess.

        Parameters
        ----------
        window
            Measurements; a weight of zero leaves one out.
        mean, factor
            Arrival: mean (n,) of z at the start, and a factor L (n, n) of its covariance.
        z, w
            Guess: trajectory (N + 1, n) and noise (N, n).
        """
        data = np.column_stack([window.time, window.inputs, window.parameters, window.measured, window.weight])
        omega = w @ np.linalg.pinv(self._noise).T if self._r else np.zeros((self._rows, 0))
        arguments = np.concatenate([data.ravel(), mean, factor.ravel(order="F")])
        if not (np.isfinite(arguments).all() and np.isfinite(z).all()):
            return HorizonSolution(z, w, False)
        result = self._solve(
            x0=self._packed(z, omega, np.zeros(self._n)), p=arguments, lbx=self._lower, ubx=self._upper, lbg=0, ubg=0
        )
        values, gaps = np.array(result["x"]).ravel(), np.array(result["g"]).ravel()
        valid = bool(np.isfinite(values).all() and np.abs(gaps).max() < 1e-6 and self._solve.stats()["success"])
        return self._unpacked(values, valid)

    def _unpacked(self, values: FloatArray, valid: bool) -> HorizonSolution:
        n, r = self._n, self._r
        starts = [k * (n + r) + (n if k else 0) for k in range(self._rows + 1)]
        z = np.array([values[i : i + n] for i in starts]) * self._scale
        omega = np.array([values[i + n : i + n + r] for i in starts[:-1]]).reshape(self._rows, r)
        return HorizonSolution(z, omega @ self._noise.T, valid)


def _interval(
    setup: Setup, coordinates: Coordinates, scale: FloatArray, noise: FloatArray
) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Scaled end of an interval (n,), weighted errors (m,) and their derivatives (m, n + r), as functions."""
    step = Stepper(setup.model, setup.dt).step
    _, t, u, p = step.sx_in()
    nx, m = len(setup.model.states), len(setup.outputs)
    x, omega = ca.SX.sym("x", scale.size), ca.SX.sym("omega", noise.shape[1])
    measured, weight = ca.SX.sym("measured", m), ca.SX.sym("weight", m)
    s = x * scale + ca.DM(noise) @ omega
    theta, _ = coordinates.symbolic(s[nx:])
    p_now = ca.SX(p)
    p_now[setup.model.indices("parameters", setup.parameters)] = theta
    end, y, _ = step(s[:nx], t, u, p_now)
    error = weight * (measured - y[setup.model.indices("outputs", setup.outputs)])
    data = ca.vertcat(t, u, p, measured, weight)
    arguments = [x, omega, data]
    gap = ca.Function("gap", arguments, [ca.densify(ca.vertcat(end, s[nx:]) / scale)], {"cse": True})
    residual = ca.Function("residual", arguments, [ca.densify(error)], {"cse": True})
    by_unknowns = ca.densify(ca.jacobian(error, ca.vertcat(x, omega)))
    slopes = ca.Function("slopes", arguments, [by_unknowns], {"cse": True})
    return gap, residual, slopes


def _gauss_newton(slopes: ca.MX, rows: int, n: int, r: int) -> list[ca.MX]:
    """Blocks of the Hessian 2 (J'J + I on the noise) in the order of the unknowns; xi comes behind the first noise."""
    blocks = []
    unit = ca.diagcat(ca.DM.zeros(n, n), ca.DM.eye(r))
    for k in range(rows):
        J = slopes[:, k * (n + r) : (k + 1) * (n + r)]
        blocks.append(2 * (J.T @ J + ca.densify(unit)))
        if k == 0:
            blocks.append(ca.MX(2 * ca.DM.eye(n)))
    return [*blocks, ca.MX(n, n)]


def _hessian(unknowns: ca.MX, p: ca.MX, equations: int, n: int, blocks: list[ca.MX]) -> ca.Function:
    cost, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", equations * n)
    hessian = ca.triu(cost * ca.diagcat(*blocks))
    names = ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
    return ca.Function("nlp_hess_l", [unknowns, p, cost, multipliers], [hessian], *names)
