"""The scenario tree as one NLP: the nominal plan and S - 1 branches with states of their own, and one first move.

The value is that of the nominal plan. Branches, each with parameters and biases of its own, have to keep the limits
after the same first move; what they do later is their own matter. They are shorter than the horizon: what the first
move can spoil shows soon.

All stand one behind the other as a single chain of stages, in the order that fatrop factorises in linear time. Where
one ends, the next state is the state now, whatever came before. The first move is carried along the chain as m further
states, so that every branch can be held to it. Source of the tree: Lucia, Finkler & Engell, Journal of Process Control
23 (2013) 1306, with robust horizon 1.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.collocation import CSE, OptimalControlProblem
from controllers.economic_mpc.derivatives import Derivatives, IntArray, sparse
from controllers.economic_mpc.layout import DEGREE


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
    nlp, names, equality, constraints
        As those of `OptimalControlProblem`; p holds the arguments of each scenario in turn.
    structure
        Options of fatrop that say where the stages lie.
    count
        S.
    """

    def __init__(self, problem: OptimalControlProblem, count: int, branch: int) -> None:
        self.problem, self.layout, self.count = problem, problem.layout, count
        layout = self.layout
        n, m = layout.state_size, layout.inputs_size
        self.moves = np.array([layout.horizon] + [branch] * (count - 1))
        self.length = int(self.moves.sum())
        self._scenario = np.repeat(np.arange(count), self.moves)
        self._move = np.concatenate([np.arange(moves) for moves in self.moves])
        self._first = self._move == 0
        self._last = np.roll(self._first, -1)
        self._last[-1] = False  # nothing follows: its end is the end of the chain
        carried = np.full(self.length, m)
        carried[0] = 0
        begin = np.concatenate([[0], np.cumsum(layout.block + carried)])
        self.size = int(begin[-1]) + n
        local = np.tile(np.arange(layout.block), (self.length, 1))
        self._columns: IntArray = begin[:-1, None] + local + np.where(local < n, 0, carried[:, None])
        self._next_x: IntArray = begin[1:, None] + np.arange(n)
        self._carry: IntArray = begin[1:-1, None] + n + np.arange(m)  # where stage k + 1 has the first move
        self._rows_of(carried)
        ones = self._ones()
        rows, columns, values = (np.array(part) for part in ones)
        self._constant = sparse((self.rows, self.size), rows, columns, ca.DM(values))
        self._write()

    def _rows_of(self, carried: IntArray) -> None:
        """Rows of the gaps, of the first move handed on, of the start, of the moves held to it, and of the rest."""
        layout, stage = self.layout, self.problem.stage
        n, m, others = layout.state_size, layout.inputs_size, len(stage.names) - layout.state_size
        self._stage_rows = np.zeros((self.length, n + others), dtype=np.intp)
        self._handed = np.zeros((self.length - 1, m), dtype=np.intp)
        held: list[IntArray] = []
        row, names, sizes = 0, [], []
        for k in range(self.length):
            self._stage_rows[k, :n] = row + np.arange(n)
            row += n
            if k < self.length - 1:
                self._handed[k] = row + np.arange(m)
                row += m
            begin, extra = row, n if k == 0 else (m if self._first[k] else 0)
            if k == 0:
                self._start = row + np.arange(n)
            elif self._first[k]:
                held.append(row + np.arange(m))
            row += extra
            self._stage_rows[k, n:] = row + np.arange(others)
            row += others
            where = f"scenario {self._scenario[k] + 1}, {self._move[k] * layout.move_s:g} s: "
            names += [where + name for name in stage.names[:n]]
            names += [where + "first move handed on"] * (m if k < self.length - 1 else 0)
            names += [where + ("start" if k == 0 else "the first move is that of all")] * extra
            names += [where + name for name in stage.names[n:]]
            sizes.append(row - begin)
        self._held = np.array(held, dtype=np.intp).reshape(-1, m)
        self.rows, self.names = row, names
        equal = np.ones(row, dtype=bool)
        points = DEGREE * layout.point_size
        equal[self._stage_rows[:, n + points :]] = False
        self.equality: list[bool] = equal.tolist()
        self.structure: dict[str, Any] = {
            "structure_detection": "manual",
            "N": self.length,
            "nx": [n, *(n + carried[1:]).tolist(), n],
            "nu": [layout.control_size] * self.length + [0],
            "ng": [*sizes, 0],
        }

    def _ones(self) -> tuple[list[int], list[int], FloatArray]:
        """Entries of the Jacobian that are constant: rows, columns, values."""
        layout = self.layout
        n, m = layout.state_size, layout.inputs_size
        u = self._columns[:, n : n + m]
        handed_from = np.vstack([u[:1], self._carry[:-1]])
        held_to = self._carry[np.flatnonzero(self._first)[1:] - 1]
        parts = [
            (self._stage_rows[:, :n], self._next_x, 1.0),
            (self._handed, self._carry, 1.0),
            (self._handed, handed_from, -1.0),
            (self._start, self._columns[0, :n], 1.0),
            (self._held, u[self._first][1:], 1.0),
            (self._held, held_to, -1.0),
        ]
        rows, columns = (np.concatenate([part[i].ravel() for part in parts]) for i in (0, 1))  # type: ignore[union-attr]
        values = np.concatenate([np.full(part[0].size, part[2]) for part in parts])
        return rows.tolist(), columns.tolist(), values

    def _write(self) -> None:
        problem, layout, stage = self.problem, self.layout, self.problem.stage
        n, count = layout.state_size, stage.arguments.vector.numel()
        x, p = ca.MX.sym("x", self.size), ca.MX.sym("p", count * self.count)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.rows)
        of = Derivatives(problem, self.length)
        columns, rows = self._columns.ravel().tolist(), self._stage_rows.ravel().tolist()
        w = ca.reshape(x[columns], layout.block, self.length)
        begin = problem.begin[:, self._move.tolist()]
        own = ca.reshape(p, count, self.count)[:, self._scenario.tolist()]
        value = ca.Function("stage_terms", [stage.variables, stage.begin, stage.arguments.vector], [stage.terms], CSE)
        f = -ca.sum1(ca.sum2(value.map(self.length)(w, begin, own)))
        lines = ca.Function(
            "stage_constraints",
            [stage.variables, stage.begin, stage.arguments.vector],
            [ca.substitute(stage.constraints, stage.after, ca.SX.zeros(n))],
            CSE,
        ).map(self.length)(w, begin, own)
        goes_on = ca.repmat(ca.DM(1.0 - self._last).T, n, 1)
        g = ca.MX.zeros(self.rows, 1)
        now = problem.now(p[:count])
        g[rows] = ca.vec(ca.vertcat(lines[:n, :] * goes_on - now @ ca.DM(self._last.astype(float)).T, lines[n:, :]))
        g[self._start.tolist()] = -now
        g = g + self._constant @ x
        self.nlp: dict[str, Any] = {"x": x, "f": f, "g": g, "p": p}
        self.constraints = ca.Function("constraints", [x, p], [g])
        self._symbols = x, p, lam_f, lam_g
        # derivatives
        slopes = ca.MX.zeros(self.size, 1)
        slopes[columns] = ca.vec(of.gradient(w, begin, own))
        jacobian = self._jacobian(of, of.jacobian(w, begin, own))
        of_lines = ca.reshape(lam_g[rows], len(stage.names), self.length)
        masked = ca.vertcat(of_lines[:n, :] * goes_on, of_lines[n:, :])
        slope, curvature = of.hessian(w, begin, own, lam_f, masked)
        lagrangian = ca.MX.zeros(self.size, 1)
        lagrangian[columns] = ca.vec(slope)
        lagrangian = lagrangian + self._constant.T @ lam_g
        self._results = f, g, slopes, jacobian, lagrangian, (of, curvature)

    def _jacobian(self, of: Derivatives, entries: ca.MX) -> ca.MX:
        pattern = of.jacobian_pattern
        rows, columns = self._stage_rows[:, pattern.rows], self._columns[:, pattern.columns]
        keep = ~(self._last[:, None] & (pattern.rows < self.layout.state_size)[None, :])
        ones = self._ones()
        return sparse(
            (self.rows, self.size),
            np.concatenate([rows[keep], ones[0]]),
            np.concatenate([columns[keep], ones[1]]),
            ca.vertcat(ca.vec(entries)[np.flatnonzero(keep).tolist()], ca.DM(ones[2])),
        )

    def functions(self, solver: str) -> dict[str, ca.Function]:
        """What `ipopt` or `fatrop` asks for, by the names of the solver option `cache`."""
        x, p, lam_f, lam_g = self._symbols
        f, g, slopes, jacobian, lagrangian, (of, curvature) = self._results
        triangle, pattern = solver == "ipopt", of.hessian_pattern
        keep = np.flatnonzero(pattern.rows <= pattern.columns) if triangle else np.arange(len(pattern.rows))
        hessian = sparse(
            (self.size, self.size),
            self._columns[:, pattern.rows[keep]].ravel(),
            self._columns[:, pattern.columns[keep]].ravel(),
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

    # -- vectors ---------------------------------------------------------------------------------------------------

    def joined(self, solutions: list[FloatArray]) -> FloatArray:
        """Variables of the tree (size,) from those of each scenario, as the nominal problem has them (n,) or longer."""
        layout = self.layout
        x = np.zeros(self.size)
        x[self._columns] = np.concatenate([layout.stages(v)[:k] for v, k in zip(solutions, self.moves, strict=True)])
        n, m = layout.state_size, layout.inputs_size
        x[self._carry] = layout.stages(solutions[0])[0, n : n + m]
        x[self._next_x[-1]] = self._end(x[self._columns[-1]])
        return x

    def split(self, x: FloatArray) -> list[FloatArray]:
        """Variables of each scenario as the nominal problem has them; a branch repeats its last stage up to the end."""
        found = []
        for s in range(self.count):
            stages = x[self._columns[self._scenario == s]]
            stages = np.vstack([stages, *[stages[-1:]] * (self.layout.horizon - len(stages))])
            found.append(np.concatenate([stages.ravel(), self._end(stages[-1])]))
        return found

    def bounds(self, plain: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Bounds of the tree from those of the nominal problem."""
        layout, found = self.layout, {}
        for key, empty in (("lbx", -np.inf), ("ubx", np.inf)):
            found[key] = np.full(self.size, empty)
            found[key][self._columns] = layout.stages(plain[key])[self._move]
        for key in ("lbg", "ubg"):
            found[key] = np.zeros(self.rows)
            found[key][self._stage_rows] = plain[key][layout.stage_rows][self._move]
        return found

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of each variable, see `StageLayout.physical`."""
        low, high = (np.full(self.size, end) for end in (-np.inf, np.inf))
        for ends, own in zip((low, high), self.layout.physical(), strict=True):
            ends[self._columns] = self.layout.stages(own)[self._move]
        return low, high

    def _end(self, stage: FloatArray) -> FloatArray:
        """State and inputs at the end of a stage (block,)."""
        layout = self.layout
        n, nx = layout.state_size, layout.state_size - layout.inputs_size
        end = layout.point(DEGREE - 1)
        return np.concatenate([stage[end : end + nx], stage[n : n + layout.inputs_size]])


def _function(name: str, given: dict[str, ca.MX], results: dict[str, ca.MX]) -> ca.Function:
    return ca.Function(name, [*given.values()], [*results.values()], [*given], [*results])
