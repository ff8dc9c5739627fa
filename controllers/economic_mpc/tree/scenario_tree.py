"""The scenario tree as one NLP: the nominal plan and S - 1 branches with states of their own, and one first move.

The value is that of the nominal plan. Branches, each with parameters and biases of its own, have to keep the limits
after the same first move; what they do later is their own matter. They are shorter than the horizon: what the first
move can spoil shows soon. `tree_layout.py` says how they stand in one vector. Source of the tree: Lucia, Finkler &
Engell, Journal of Process Control 23 (2013) 1306, with robust horizon 1.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.collocation import CSE, OptimalControlProblem
from controllers.economic_mpc.problem.derivatives import Derivatives, sparse
from controllers.economic_mpc.tree.tree_layout import TreeLayout


class ScenarioTree:
    """NLP of S scenarios of a problem; the first one is the nominal one.

    Parameters
    ----------
    problem
        The problem of the nominal plan.
    count
        S, from 2.
    branch
        Moves of a branch, at most those of the horizon.

    Attributes
    ----------
    at
        Where everything lies.
    begin
        Time between now and the begin of each stage [s] (1, L).
    nlp, names, equality, structure, constraints
        As those of `OptimalControlProblem`; p holds the arguments of each scenario in turn.
    """

    def __init__(self, problem: OptimalControlProblem, count: int, branch: int) -> None:
        self.problem, self.count = problem, count
        self.at = at = TreeLayout(problem.layout, problem.stage.names, count, branch)
        self.names, self.equality, self.structure = at.names, at.equality, at.structure
        self.begin = problem.begin[:, at.move.tolist()]
        rows, columns, values = at.ones()
        self._ones = np.array(rows), np.array(columns), ca.DM(values)
        self._constant = sparse((at.rows, at.size), *self._ones)
        self._write()

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of each variable, see `StageLayout.physical`."""
        return self.at.physical()

    def stages(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Variables (block, L) and arguments (a column each) of the stages."""
        at = self.at
        w = ca.reshape(x[at.columns.ravel().tolist()], at.layout.block, at.length)
        own = ca.reshape(p, self.problem.stage.arguments.vector.numel(), self.count)
        return w, own[:, at.scenario.tolist()]

    def _write(self) -> None:
        problem, at, stage = self.problem, self.at, self.problem.stage
        layout, begin = at.layout, self.begin
        n, count = layout.state_size, stage.arguments.vector.numel()
        x, p = ca.MX.sym("x", at.size), ca.MX.sym("p", count * self.count)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", at.rows)
        of = Derivatives(problem, at.length)
        columns, rows = at.columns.ravel().tolist(), at.stage_rows.ravel().tolist()
        w, own = self.stages(x, p)
        value = ca.Function("stage_terms", [stage.variables, stage.begin, stage.arguments.vector], [stage.terms], CSE)
        f = -ca.sum1(ca.sum2(value.map(at.length)(w, begin, own)))
        lines = ca.Function(
            "stage_constraints",
            [stage.variables, stage.begin, stage.arguments.vector],
            [ca.substitute(stage.constraints, stage.after, ca.SX.zeros(n))],
            CSE,
        ).map(at.length)(w, begin, own)
        goes_on = ca.repmat(ca.DM(1.0 - at.last).T, n, 1)
        g = ca.MX.zeros(at.rows, 1)
        now = problem.now(p[:count])
        g[rows] = ca.vec(ca.vertcat(lines[:n, :] * goes_on - now @ ca.DM(at.last.astype(float)).T, lines[n:, :]))
        g[at.start.tolist()] = -now
        g = g + self._constant @ x
        self.nlp: dict[str, Any] = {"x": x, "f": f, "g": g, "p": p}
        self.constraints = ca.Function("constraints", [x, p], [g])
        self._symbols = x, p, lam_f, lam_g
        # derivatives
        slopes = ca.MX.zeros(at.size, 1)
        slopes[columns] = ca.vec(of.gradient(w, begin, own))
        jacobian = self._jacobian(of, of.jacobian(w, begin, own))
        of_lines = ca.reshape(lam_g[rows], len(stage.names), at.length)
        masked = ca.vertcat(of_lines[:n, :] * goes_on, of_lines[n:, :])
        slope, curvature = of.hessian(w, begin, own, lam_f, masked)
        lagrangian = ca.MX.zeros(at.size, 1)
        lagrangian[columns] = ca.vec(slope)
        lagrangian = lagrangian + self._constant.T @ lam_g
        self._results = f, g, slopes, jacobian, lagrangian, (of, curvature)

    def _jacobian(self, of: Derivatives, entries: ca.MX) -> ca.MX:
        at, pattern = self.at, of.jacobian_pattern
        rows, columns = at.stage_rows[:, pattern.rows], at.columns[:, pattern.columns]
        keep = ~(at.last[:, None] & (pattern.rows < at.layout.state_size)[None, :])
        ones = self._ones
        return sparse(
            (at.rows, at.size),
            np.concatenate([rows[keep], ones[0]]),
            np.concatenate([columns[keep], ones[1]]),
            ca.vertcat(ca.vec(entries)[np.flatnonzero(keep).tolist()], ones[2]),
        )

    def functions(self, solver: str) -> dict[str, ca.Function]:
        """What `ipopt` or `fatrop` asks for, by the names of the solver option `cache`."""
        at, (x, p, lam_f, lam_g) = self.at, self._symbols
        f, g, slopes, jacobian, lagrangian, (of, curvature) = self._results
        triangle, pattern = solver == "ipopt", of.hessian_pattern
        keep = np.flatnonzero(pattern.rows <= pattern.columns) if triangle else np.arange(len(pattern.rows))
        hessian = sparse(
            (at.size, at.size),
            at.columns[:, pattern.rows[keep]].ravel(),
            at.columns[:, pattern.columns[keep]].ravel(),
            ca.vec(curvature[keep.tolist(), :]),
        )
        value = {"f": f} if triangle else {}
        second = (
            {"triu_hess_gamma_x_x": hessian} if triangle else {"grad_gamma_x": lagrangian, "hess_gamma_x_x": hessian}
        )
        both = {"x": x, "p": p}
        return {
            "nlp_grad_f": _function("nlp_grad_f", both, {**value, "grad_f_x": slopes}),
            "nlp_jac_g": _function("nlp_jac_g", both, {"g": g, "jac_g_x": jacobian}),
            "nlp_hess_l": _function("nlp_hess_l", {**both, "lam_f": lam_f, "lam_g": lam_g}, second),
        }


def _function(name: str, given: dict[str, ca.MX], results: dict[str, ca.MX]) -> ca.Function:
    return ca.Function(name, [*given.values()], [*results.values()], [*given], [*results])
