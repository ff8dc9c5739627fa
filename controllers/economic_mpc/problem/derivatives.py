"""Derivatives of the optimal control problem: those of one stage, mapped over all of them.

The Hessian of the Lagrangian is the dearest: it takes more operations than all other functions together. Half of them
are the curvature along the fast states, those for which the model gives a decay rate. In a flotation cell these are the
gas of each bubble class, which follows the air flow within seconds. A move of 30 s sees them settled. The curvature
along them hardly changes a solver's steps (7 iterations instead of 6), so it is left out. That changes how a solution
is found, never what it is: equations, gradient and Jacobian stay exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from controllers.economic_mpc.problem.collocation import CSE, OptimalControlProblem
from controllers.economic_mpc.problem.layout import DEGREE

IntArray = NDArray[np.intp]
T = TypeVar("T", ca.DM, ca.SX, ca.MX)


@dataclass(frozen=True)
class Pattern:
    """Row and column of each entry of a sparse matrix of one stage, in the order in which it is evaluated (nnz,)."""

    rows: IntArray
    columns: IntArray

    @classmethod
    def of(cls, matrix: ca.SX) -> Pattern:
        """Pattern of a matrix, in the order of its `nonzeros()`."""
        rows, columns = matrix.sparsity().get_triplet()
        return cls(np.array(rows, dtype=np.intp), np.array(columns, dtype=np.intp))


class Derivatives:
    """Mapped functions of a problem, each with the stages as columns.

    Parameters
    ----------
    problem
        The problem.
    stages
        Number of stages, each with arguments p of its own (a column each); default: those of the horizon, p for all.

    Attributes
    ----------
    jacobian, jacobian_pattern
        (stages, begin, p) -> entries of the stage's constraints by its variables (nnz, horizon); the variables of the
        next stage enter the gap only, with factor 1.
    gradient
        (stages, begin, p) -> objective by the variables (block, horizon).
    hessian, hessian_pattern
        (stages, begin, p, lam_f, lam_g) -> gradient of the Lagrangian (block, horizon) and entries of its Hessian
        (nnz, horizon), both triangles; without the part of the gradient that the next stage's gap adds.
    """

    def __init__(self, problem: OptimalControlProblem, stages: int | None = None) -> None:
        self.problem = problem
        self._stages, self._alike = stages or problem.layout.horizon, stages is None
        stage = problem.stage
        w, p, t = stage.variables, stage.arguments.vector, stage.begin
        lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", stage.constraints.numel())
        cost = -ca.sum1(stage.terms)
        jacobian, gradient = ca.jacobian(stage.constraints, w), ca.gradient(cost, w)
        slope = ca.gradient(lam_f * cost + ca.dot(lam_g, stage.constraints), w)
        hessian = self._hessian(slope)
        self.jacobian_pattern, self.hessian_pattern = Pattern.of(jacobian), Pattern.of(hessian)
        entries, curvature = _entries(jacobian), _entries(hessian)
        self.jacobian = self._mapped("jacobian", [w, t, p], [entries], [2])
        self.gradient = self._mapped("gradient", [w, t, p], [gradient], [2])
        self.hessian = self._mapped("hessian", [w, t, p, lam_f, lam_g], [slope, curvature], [2, 3])
        self._all = [w, stage.after, t, p, lam_f, lam_g], [stage.constraints, entries, gradient, curvature], [3, 4]

    def together(self) -> ca.Function:
        """(stages, after, begin, p, lam_f, lam_g) -> constraints, entries of jacobian, gradient, entries of hessian.

        One function works out only once what they have in common: a quarter of the operations.
        """
        return self._mapped("together", *self._all)

    def _mapped(self, name: str, inputs: list[ca.SX], results: list[ca.SX], shared: list[int]) -> ca.Function:
        """A function of all stages; the inputs with the indices `shared` are the same for all."""
        one = ca.Function(f"stage_{name}", inputs, results, CSE)
        if self._alike:
            return one.map(name, "serial", self._stages, shared, [])
        factor = [i for i, given in enumerate(inputs) if i in shared and given.is_scalar()]  # that of the objective
        return one.map(name, "serial", self._stages, factor, [])

    def _hessian(self, slope: ca.SX) -> ca.SX:
        """Both triangles from one: of each pair of entries only one is worked out, the one that takes less.

        Derivatives by states (those of the minerals least) take fewer operations than derivatives by inputs, and
        these fewer than derivatives by algebraic variables; counted for the flotation cell, all together a fifth less.
        """
        model, layout = self.problem.model, self.problem.layout
        t, x, u, p, z = model.decay.sx_in()
        fast = [i for i, rate in enumerate(ca.vertsplit(model.decay(t, x, u, p, z))) if not rate.is_zero()]
        left_out = {layout.point(j) + i for j in range(DEGREE) for i in fast}
        states, algebraic = len(model.states), len(model.algebraic)
        points = [layout.point(j) for j in range(DEGREE)]
        order = [b + i for b in points for i in reversed(range(states))] + list(range(layout.points))
        order += [b + states + i for b in points for i in range(algebraic)]
        curved = [i for i in order if i not in left_out]
        upper = ca.triu(ca.jacobian(slope[curved], self.problem.stage.variables[curved]))
        rows, columns = (np.array(curved)[index] for index in upper.sparsity().get_triplet())
        below = np.flatnonzero(rows != columns)
        rows, columns = np.append(rows, columns[below]), np.append(columns, rows[below])
        entries = _entries(upper)
        return sparse((layout.block, layout.block), rows, columns, ca.vertcat(entries, entries[below.tolist()]))


class Assembled:
    """The derivatives of the whole problem as CasADi functions that `casadi.nlpsol` takes in place of its own."""

    def __init__(self, problem: OptimalControlProblem) -> None:
        self.problem, self.of_stages = problem, Derivatives(problem)
        self._x, self._p = problem.nlp["x"], problem.nlp["p"]
        self._lam_f, self._lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", problem.nlp["g"].numel())
        self._stages, _ = problem.split(self._x)

    def functions(self, solver: str) -> dict[str, ca.Function]:
        """What `ipopt` or `fatrop` asks for, by the names of the solver option `cache`."""
        g, gradient = self.problem.nlp["g"], self._gradient()
        slope, hessian = self._second(triangle=solver == "ipopt")
        value = {"f": self.problem.nlp["f"]} if solver == "ipopt" else {}
        curvature = {"triu_hess_gamma_x_x": hessian} if solver == "ipopt" else {"hess_gamma_x_x": hessian}
        lagrangian = {} if solver == "ipopt" else {"grad_gamma_x": slope}
        return {
            "nlp_grad_f": self._function("nlp_grad_f", **value, grad_f_x=gradient),
            "nlp_jac_g": self._function("nlp_jac_g", g=g, jac_g_x=self._jacobian()),
            "nlp_hess_l": self._function("nlp_hess_l", multipliers=True, **lagrangian, **curvature),
        }

    def _gradient(self) -> ca.MX:
        stages = ca.vec(self.of_stages.gradient(self._stages, self.problem.begin, self._p))
        # zeros that are stored: the solvers read every entry, those of a sparse vector beyond its end
        return ca.vertcat(stages, ca.MX.zeros(self.problem.layout.state_size, 1))

    def _jacobian(self) -> ca.MX:
        """Entries of the stages, and ones where the initial condition and the gaps meet the x of a stage."""
        layout, pattern = self.problem.layout, self.of_stages.jacobian_pattern
        entries = ca.vec(self.of_stages.jacobian(self._stages, self.problem.begin, self._p))
        rows = layout.stage_rows[:, pattern.rows].ravel()
        columns = (np.arange(layout.horizon)[:, None] * layout.block + pattern.columns).ravel()
        x = np.arange(layout.horizon + 1)[:, None] * layout.block + np.arange(layout.state_size)
        meets = np.vstack([layout.rows["initial"], layout.rows["gap"]])
        shape = (self._lam_g.numel(), layout.size)
        ones = ca.MX.ones(x.size, 1)
        return sparse(
            shape,
            np.concatenate([rows, meets.ravel()]),
            np.concatenate([columns, x.ravel()]),
            ca.vertcat(entries, ones),
        )

    def _second(self, triangle: bool) -> tuple[ca.MX, ca.MX]:
        """Gradient and Hessian of the Lagrangian."""
        layout, pattern = self.problem.layout, self.of_stages.hessian_pattern
        lines = ca.reshape(self._lam_g[layout.stage_rows.ravel().tolist()], -1, layout.horizon)
        slope, entries = self.of_stages.hessian(self._stages, self.problem.begin, self._p, self._lam_f, lines)
        n = layout.state_size
        meets = ca.horzcat(self._lam_g[layout.rows["initial"].ravel().tolist()], lines[:n, :])
        whole = ca.vertcat(slope[:n, :] + meets[:, :-1], slope[n:, :])
        keep = np.flatnonzero(pattern.rows <= pattern.columns) if triangle else np.arange(len(pattern.rows))
        begin = np.arange(layout.horizon)[:, None] * layout.block
        rows, columns = ((begin + index[keep]).ravel() for index in (pattern.rows, pattern.columns))
        hessian = sparse((layout.size, layout.size), rows, columns, ca.vec(entries[keep.tolist(), :]))
        return ca.vertcat(ca.vec(whole), meets[:, -1]), hessian

    def _function(self, name: str, *, multipliers: bool = False, **results: ca.MX) -> ca.Function:
        arguments = {"x": self._x, "p": self._p}
        if multipliers:
            arguments |= {"lam_f": self._lam_f, "lam_g": self._lam_g}
        return ca.Function(name, [*arguments.values()], [*results.values()], [*arguments], [*results])


def _entries(matrix: ca.SX) -> ca.SX:
    stored: ca.SX = matrix.nz[:]
    return stored


def sparse(shape: tuple[int, int], rows: IntArray, columns: IntArray, entries: T) -> T:
    """Matrix of entries given in any order."""
    order = np.lexsort((rows, columns))  # by columns, as CasADi stores them
    pattern = ca.Sparsity.triplet(*shape, rows[order].tolist(), columns[order].tolist())
    return type(entries)(pattern, entries[order.tolist()])
