"""The linearised optimal control problem in the moves alone: a small dense quadratic programme.

With the equations of a stage linearised, its collocation points follow from the state at its begin and the moved
inputs: one linear system a stage. The states follow from the inputs before them. What is left are the inputs and slacks
of the horizon (Bock and Plitt 1984; the names of the blocks below are those of a linear system dx' = A dx + B du + b).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.layout import StageLayout


@dataclass(frozen=True)
class LinearisedStages:
    """Functions of each of the K stages at a plan; the variables of a stage are those of `StageLayout`.

    Attributes
    ----------
    constraints, jacobian
        Rows of a stage without the initial condition (K, m) and their derivatives by its variables (K, m, block).
    initial
        Residual of the initial condition (state_size,).
    gradient, hessian
        Of the objective (K, block) and of the Lagrangian (K, block, block).
    """

    constraints: FloatArray
    jacobian: FloatArray
    initial: FloatArray
    gradient: FloatArray
    hessian: FloatArray


class Condensed:
    """Quadratic programme in the changes of all inputs and then of all slacks: (K inputs + K slacks,).

    Attributes
    ----------
    hessian, gradient
        Of the objective; the Hessian is that of all inputs, as it is: it need not be convex.
    slack_hessian, slack_gradient
        Of all slacks, one entry each: nothing couples them.
    rows, offsets
        Inequalities of all stages (moves, outputs, states) by inputs and slacks, and their values at no change.
    """

    def __init__(self, layout: StageLayout, at: LinearisedStages) -> None:
        self.layout, self.at = layout, at
        self._eliminate_points()
        self._eliminate_states()
        self._write()

    def _eliminate_points(self) -> None:
        """Points by state, inputs and slacks: dw = T (dx, du, ds) + t."""
        layout, at = self.layout, self.at
        nx, points = layout.state_size, layout.points
        equations = at.jacobian[:, nx : nx + layout.block - points]
        self.inverse = np.linalg.inv(equations[:, :, points:])
        k, size = layout.horizon, points
        self.t = np.zeros((k, layout.block))
        self.t[:, points:] = -_times(self.inverse, at.constraints[:, nx : nx + layout.block - points])
        self.T = np.zeros((k, layout.block, size))
        self.T[:, :size] = np.eye(size)
        self.T[:, points:] = -self.inverse @ equations[:, :, :points]

    def _eliminate_states(self) -> None:
        """States at the begin of each stage by all inputs: dx = X du + xi."""
        layout, at = self.layout, self.at
        nx, horizon, m = layout.state_size, layout.horizon, layout.inputs_size
        gap = at.jacobian[:, :nx]
        moved = -gap @ self.T
        b = -at.constraints[:, :nx] - _times(gap, self.t)
        self.X, self.xi = np.zeros((horizon, nx, horizon * m)), np.zeros((horizon, nx))
        self.xi[0] = -at.initial
        for k in range(horizon - 1):
            self.X[k + 1] = moved[k, :, :nx] @ self.X[k]
            self.X[k + 1, :, k * m : (k + 1) * m] += moved[k, :, nx : nx + m]
            self.xi[k + 1] = moved[k, :, :nx] @ self.xi[k] + b[k]

    def _write(self) -> None:
        layout, at = self.layout, self.at
        nx, horizon = layout.state_size, layout.horizon
        m, slacks = layout.inputs_size, layout.slacks_size
        free = horizon * m
        chosen = nx + m
        T, t = self.T[:, :, :chosen], self.t + _times(self.T[:, :, :nx], self.xi)
        choice = np.zeros((horizon, chosen, free))
        choice[:, :nx] = self.X
        for k in range(horizon):
            choice[k, nx:, k * m : (k + 1) * m] = np.eye(m)
        self.Y, self.y = T @ choice, t  # dw = Y du + y, but for the slacks
        tall = self.Y.reshape(-1, free)
        self.hessian = tall.T @ (at.hessian @ self.Y).reshape(-1, free)
        self.gradient = tall.T @ (at.gradient + _times(at.hessian, self.y)).ravel()
        slack = slice(chosen, chosen + slacks)
        self.slack_gradient = at.gradient[:, slack].ravel()
        self.slack_hessian = np.diagonal(at.hessian[:, slack, slack], axis1=1, axis2=2).ravel()
        kept = slice(nx + layout.block - layout.points, None)
        inequalities = at.jacobian[:, kept]
        self.offsets = (at.constraints[:, kept] + _times(inequalities, self.y)).ravel()
        of_slacks = np.zeros((horizon, inequalities.shape[1], horizon * slacks))
        for k in range(horizon):
            of_slacks[k, :, k * slacks : (k + 1) * slacks] = inequalities[k, :, slack]
        self.rows = np.concatenate([inequalities @ self.Y, of_slacks], axis=2).reshape(-1, horizon * (m + slacks))

    def change(self, solution: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Changes of the stages (K, block) and of the last state (state_size,) from a solution of the programme."""
        layout, at, m = self.layout, self.at, self.layout.inputs_size
        inputs, slacks = np.split(solution, [layout.horizon * m])
        dw = self.Y @ inputs + self.y
        begin = layout.state_size + m
        dw[:, begin : begin + layout.slacks_size] = slacks.reshape(-1, layout.slacks_size)
        last = -at.constraints[-1, : layout.state_size] - at.jacobian[-1, : layout.state_size] @ dw[-1]
        return dw, last

    def multipliers(self, dw: FloatArray, of_rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Multipliers of the stages' rows (K, m) and of the initial condition (state_size,), from the last stage on.

        Each makes the Lagrangian stationary in the variable that its equation was used to eliminate.
        """
        layout, at = self.layout, self.at
        nx, points, horizon = layout.state_size, layout.points, layout.horizon
        count = layout.block - points
        multipliers = np.zeros_like(at.constraints)
        multipliers[:, nx + count :] = of_rows.reshape(horizon, -1)
        slope = at.gradient + _times(at.hessian, dw) + _times(at.jacobian.transpose(0, 2, 1), multipliers)
        next_x = np.zeros(nx)
        for k in reversed(range(horizon)):
            multipliers[k, :nx] = -next_x
            slope[k] += at.jacobian[k, :nx].T @ multipliers[k, :nx]
            multipliers[k, nx : nx + count] = -self.inverse[k].T @ slope[k, points:]
            next_x = slope[k, :nx] + at.jacobian[k, nx : nx + count, :nx].T @ multipliers[k, nx : nx + count]
        return multipliers, -next_x


def _times(matrices: Any, vectors: FloatArray) -> FloatArray:
    """Matrices (K, a, b) times vectors (K, b)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])
