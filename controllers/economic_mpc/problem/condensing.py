"""The linearised optimal control problem in the moves alone: a small dense quadratic programme.

With the equations of a stage linearised, its collocation points follow from the state at its begin and the moved
inputs: one linear system a stage. The states follow from the inputs before them. What is left are the inputs and slacks
of the horizon (Bock and Plitt 1984; the names of the blocks below are those of a linear system dx' = A dx + B du + b).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.derivatives import Derivatives
from controllers.economic_mpc.problem.layout import StageLayout


@dataclass(frozen=True)
class LinearisedStages:
    """Functions of each of the K stages at a plan; the variables of a stage are those of `StageLayout`.

    Several plans of one length may go together: then each array has their number as a further, first dimension.

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

    @classmethod
    def of(
        cls, layout: StageLayout, derivatives: Derivatives, initial: FloatArray, results: Sequence[FloatArray]
    ) -> LinearisedStages:
        """From results of `Derivatives.together`, with a column for each stage; the plans stand in initial, too."""
        of_g, of_l = derivatives.jacobian_pattern, derivatives.hessian_pattern
        lines, jacobian, gradient, hessian = (result.T for result in results)
        J = np.zeros((len(lines), lines.shape[1], layout.block))
        J[:, of_g.rows, of_g.columns] = jacobian
        H = np.zeros((len(lines), layout.block, layout.block))
        H[:, of_l.rows, of_l.columns] = hessian
        plans = initial.shape[:-1]
        each = [part.reshape(*plans, layout.horizon, *part.shape[1:]) for part in (lines, J, gradient, H)]
        return cls(each[0], each[1], initial, each[2], each[3])


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
        self._plans = at.initial.shape[:-1]
        self._eliminate_points()
        self._eliminate_states()
        self._write()

    def _eliminate_points(self) -> None:
        """Points by state, inputs and slacks: dw = T (dx, du, ds) + t."""
        layout, at = self.layout, self.at
        nx, points = layout.state_size, layout.points
        equations = slice(nx, nx + layout.block - points)
        jacobian = at.jacobian[..., equations, :]
        self.inverse = np.linalg.inv(jacobian[..., points:])
        self.t = np.zeros((*self._plans, layout.horizon, layout.block))
        self.t[..., points:] = -_times(self.inverse, at.constraints[..., equations])
        self.T = np.zeros((*self.t.shape, points))
        self.T[..., :points, :] = np.eye(points)
        self.T[..., points:, :] = -self.inverse @ jacobian[..., :points]

    def _eliminate_states(self) -> None:
        """States at the begin of each stage by all inputs: dx = X du + xi."""
        layout, at = self.layout, self.at
        nx, horizon, m = layout.state_size, layout.horizon, layout.inputs_size
        gap = at.jacobian[..., :nx, :]
        moved = -gap @ self.T
        b = -at.constraints[..., :nx] - _times(gap, self.t)
        self.X = np.zeros((*self._plans, horizon, nx, horizon * m))
        self.xi = np.zeros((*self._plans, horizon, nx))
        self.xi[..., 0, :] = -at.initial
        for k in range(horizon - 1):
            on, by = moved[..., k, :, :nx], moved[..., k, :, nx : nx + m]
            self.X[..., k + 1, :, :] = on @ self.X[..., k, :, :]
            self.X[..., k + 1, :, k * m : (k + 1) * m] += by
            self.xi[..., k + 1, :] = _times(on, self.xi[..., k, :]) + b[..., k, :]

    def _write(self) -> None:
        layout, at = self.layout, self.at
        nx, horizon = layout.state_size, layout.horizon
        m, slacks = layout.inputs_size, layout.slacks_size
        free = horizon * m
        chosen = nx + m
        self.y = self.t + _times(self.T[..., :nx], self.xi)
        choice = np.zeros((*self._plans, horizon, chosen, free))
        choice[..., :nx, :] = self.X
        for k in range(horizon):
            choice[..., k, nx:, k * m : (k + 1) * m] = np.eye(m)
        self.Y = self.T[..., :chosen] @ choice  # dw = Y du + y, but for the slacks
        turned = self.Y.swapaxes(-1, -2)
        # stage by stage: for larger products BLAS starts threads, which on a busy machine take longer than they save
        self.hessian = (turned @ (at.hessian @ self.Y)).sum(axis=-3)
        self.gradient = _times(turned, at.gradient + _times(at.hessian, self.y)).sum(axis=-2)
        slack = slice(chosen, chosen + slacks)
        self.slack_gradient = self._flat(at.gradient[..., slack], 1)
        self.slack_hessian = self._flat(np.diagonal(at.hessian[..., slack, slack], axis1=-2, axis2=-1), 1)
        inequalities = at.jacobian[..., nx + layout.block - layout.points :, :]
        lines = at.constraints[..., nx + layout.block - layout.points :]
        self.offsets = self._flat(lines + _times(inequalities, self.y), 1)
        of_slacks = np.zeros((*inequalities.shape[:-1], horizon * slacks))
        for k in range(horizon):
            of_slacks[..., k, :, k * slacks : (k + 1) * slacks] = inequalities[..., k, :, slack]
        self.rows = self._flat(np.concatenate([inequalities @ self.Y, of_slacks], axis=-1), 2)

    def _flat(self, array: FloatArray, dimensions: int) -> FloatArray:
        """All stages of a plan one behind the other; the array has so many dimensions beyond plans and stages - 1."""
        after = array.shape[len(self._plans) + 2 :] if dimensions == 2 else ()
        return array.reshape(*self._plans, -1, *after)

    def change(self, solution: FloatArray) -> FloatArray:
        """Changes of the stages (K, block) from a solution of the programme."""
        layout, m = self.layout, self.layout.inputs_size
        inputs, slacks = np.split(solution, [layout.horizon * m], axis=-1)
        dw = (self.Y @ inputs[..., None, :, None])[..., 0] + self.y
        begin = layout.state_size + m
        dw[..., begin : begin + layout.slacks_size] = slacks.reshape(*self._plans, layout.horizon, -1)
        return dw

    def last(self, dw: FloatArray) -> FloatArray:
        """Change of the state at the end of the last stage (state_size,) with those of the stages."""
        gap, at = slice(self.layout.state_size), self.at
        return np.asarray(-at.constraints[-1, gap] - at.jacobian[-1, gap] @ dw[-1])

    def multipliers(self, dw: FloatArray, of_rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Multipliers of one plan's rows (K, m) and of its initial condition (state_size,), from the last stage on.

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
    """Matrices (..., a, b) times vectors (..., b)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
