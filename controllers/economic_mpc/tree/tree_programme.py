"""The quadratic programme of a Newton step of a tree of scenarios.

Most slacks are zero. So the programme is solved without any first, which takes a fifth of the time. It is solved with
all of them only where a limit can not be kept, or costs more to keep than its price.
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.condensing import Condensed
from controllers.economic_mpc.solvers.newton_step import LEAST_CURVATURE, Programme, reflected
from controllers.economic_mpc.tree.tree_layout import TreeLayout

TOLERANCE = 1e-7
"""Of rows and prices of a programme."""
BEYOND = 0.05
"""A slack of a state's range up to this counts as none: its price is that of its square, so it is never quite zero."""


class TreeProgramme:
    """Changes of all moves and slacks from the condensed scenarios."""

    def __init__(self, at: TreeLayout) -> None:
        layout, self.at = at.layout, at
        m, s, horizon = layout.inputs_size, layout.slacks_size, layout.horizon
        branches, moves = at.count - 1, int(at.moves[-1])
        free = m * (horizon + branches * (moves - 1))
        slacks = free + np.arange(s * at.length)
        own = m * horizon + np.arange(branches * (moves - 1) * m).reshape(branches, -1)
        first = np.tile(np.arange(m), (branches, 1))
        self._plan = np.concatenate([np.arange(m * horizon), slacks[: s * horizon]])
        self._branches = np.hstack([first, own, slacks[s * horizon :].reshape(branches, -1)])
        self._free, self._size = free, free + len(slacks)
        self._slack_is_linear = np.tile(np.arange(s) < len(layout.output_limits), at.length)
        self._rows = at.stage_rows[:, layout.state_size + layout.block - layout.points :]
        self._hard = Programme(free, self._rows.size)
        self._soft = Programme(self._size, self._rows.size)

    def __call__(
        self, nominal: Condensed, branches: Condensed, w: FloatArray, bounds: dict[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve.

        Parameters
        ----------
        nominal, branches
            The nominal plan, and all branches together.
        w
            Variables of all stages (L, block).
        bounds
            Of the tree.

        Returns
        -------
        tuple
            Changes of inputs and slacks of the nominal plan and of each branch, and multipliers of the nominal rows.
        """
        layout, at = self.at.layout, self.at
        m, horizon = layout.inputs_size, layout.horizon
        inputs, of_plan = m * horizon, self._rows[:horizon].size
        hessian, gradient = LEAST_CURVATURE * np.eye(self._size), np.zeros(self._size)
        rows = np.zeros((self._rows.size, self._size))
        hessian[:inputs, :inputs] += reflected(nominal.hessian)
        gradient[self._plan] = np.concatenate([nominal.gradient, nominal.slack_gradient])
        rows[:of_plan, self._plan] = nominal.rows
        diagonal = hessian.reshape(-1)[:: self._size + 1]
        diagonal[self._plan[inputs:]] += nominal.slack_hessian
        curved, count = reflected(branches.hessian), branches.hessian.shape[-1]
        each = self._rows[horizon : horizon + at.moves[-1]].size
        for k, columns in enumerate(self._branches):
            begin = of_plan + k * each
            u = columns[:count]
            hessian[np.ix_(u, u)] += curved[k]
            gradient[u] += branches.gradient[k]
            gradient[columns[count:]] = branches.slack_gradient[k]
            diagonal[columns[count:]] += branches.slack_hessian[k]
            rows[begin : begin + each, columns] = branches.rows[k]
        offsets = np.concatenate([nominal.offsets, branches.offsets.ravel()])
        limits = [bounds[key][self._rows].ravel() - offsets for key in ("lbg", "ubg")]
        change, of_rows = self._solved(hessian, gradient, rows, limits, self._box(w, bounds))
        return change[self._plan], change[self._branches], of_rows[:of_plan]

    def _box(self, w: FloatArray, bounds: dict[str, FloatArray]) -> list[FloatArray]:
        """Lowest and highest changes of all moves and slacks."""
        at, layout = self.at, self.at.layout
        m, horizon = layout.inputs_size, layout.horizon
        behind = ~at.first
        behind[:horizon] = True  # the first move is that of the nominal plan
        found = []
        for key in ("lbx", "ubx"):
            ends = (bounds[key][at.columns] - w)[:, layout.chosen]
            found.append(np.concatenate([ends[behind, :m].ravel(), ends[:, m:].ravel()]))
        self._slack = w[:, layout.chosen][:, m:].ravel()
        return found

    def _solved(
        self,
        hessian: FloatArray,
        gradient: FloatArray,
        rows: FloatArray,
        limits: list[FloatArray],
        box: list[FloatArray],
    ) -> tuple[FloatArray, FloatArray]:
        """Changes (size,) and multipliers of the rows."""
        found = self._without_slacks(gradient, hessian, rows, limits, box)
        if found is None:
            change, of_rows, _ = self._soft(hessian, gradient, rows, limits, box)
            return change, of_rows
        return found

    def _without_slacks(
        self,
        gradient: FloatArray,
        hessian: FloatArray,
        rows: FloatArray,
        limits: list[FloatArray],
        box: list[FloatArray],
    ) -> tuple[FloatArray, FloatArray] | None:
        """The same with all slacks zero; None where that is no solution of the whole programme."""
        n, none = self._free, -self._slack
        given = np.einsum("ij,j", rows[:, n:], none)  # no BLAS: its threads take longer than they save
        ends = [side - given for side in limits]
        change, of_rows, _ = self._hard(hessian[:n, :n], gradient[:n], rows[:, :n], ends, [side[:n] for side in box])
        came = np.einsum("ij,j", rows[:, :n], change)
        if not ((came >= ends[0] - TOLERANCE).all() and (came <= ends[1] + TOLERANCE).all()):
            return None
        curvature, linear = hessian.diagonal()[n:], self._slack_is_linear
        slope = gradient[n:] + curvature * none + np.einsum("ij,i", rows[:, n:], of_rows)
        dear = (slope[linear] < -TOLERANCE).any() or (np.abs(slope) > BEYOND * curvature)[~linear].any()
        return None if dear else (np.concatenate([change, none]), of_rows)
