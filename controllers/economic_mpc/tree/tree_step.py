"""The Newton step of a tree of scenarios: each scenario condensed by itself, all in one quadratic programme.

The unknowns are the moves of the nominal plan, those of each branch behind the first, and all slacks. The first move
is that of all: the share that each branch adds to the objective and the limits stands in the same columns.

The curvature of a branch's equations is left out. A branch earns nothing, and with it the steps of moves that hardly
matter oscillate. That changes how a solution is found, not what it is.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.problem.condensing import Condensed, LinearisedStages
from controllers.economic_mpc.problem.derivatives import Derivatives
from controllers.economic_mpc.problem.layout import Multipliers
from controllers.economic_mpc.solvers.newton_step import RESULTS
from controllers.economic_mpc.tree.scenario_tree import ScenarioTree
from controllers.economic_mpc.tree.tree_programme import TreeProgramme


class TreeStep:
    """Newton steps of a tree; see `NewtonStep`.

    Only the multipliers of the nominal plan are worked out: no step needs others.
    """

    def __init__(self, tree: ScenarioTree) -> None:
        self.tree, self.at = tree, tree.at
        self._derivatives = Derivatives(tree.problem, tree.at.length)
        self._linearise = FastCall(self._all(), matrices=("w", *RESULTS))
        self._branch = tree.at.layout.with_horizon(int(tree.at.moves[-1]))
        self._programme = TreeProgramme(tree.at)

    def _all(self) -> ca.Function:
        x, p, lam = self.tree.nlp["x"], self.tree.nlp["p"], ca.MX.sym("lam", self.at.rows)
        at, n = self.at, self.at.layout.state_size
        w, own = self.tree.stages(x, p)
        goes_on = ca.repmat(ca.DM(1.0 - at.last).T, n, 1)
        after = ca.horzcat(w[:n, 1:], x[-n:]) * goes_on + w[at.ends.tolist(), :] * (1 - goes_on)
        lines = ca.reshape(lam[at.stage_rows.ravel().tolist()], -1, at.length)
        nominal = ca.repmat(ca.DM((at.scenario == 0) & ~at.last).T, n, 1)
        curved = ca.repmat(ca.DM(at.scenario == 0).T, lines.size1() - n, 1)
        multipliers = ca.vertcat(lines[:n, :] * nominal, lines[n:, :] * curved)
        results = self._derivatives.together()(w, after, self.tree.begin, own, 1.0, multipliers)
        now = self.tree.problem.now(p[: own.size1()])
        return ca.Function("all", [x, p, lam], [now, w, *results], ["x", "p", "lam"], ["now", "w", *RESULTS])

    def __call__(
        self, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray], lam: FloatArray
    ) -> tuple[FloatArray, Multipliers]:
        """Variables and multipliers one step later."""
        at, layout = self.at, self.at.layout
        n, horizon = layout.state_size, layout.horizon
        now, columns, *results = self._linearise(x, arguments, lam)
        w = columns.T
        initial = w[at.first, :n] - now
        nominal = Condensed(
            layout, LinearisedStages.of(layout, self._derivatives, initial[0], [r[:, :horizon] for r in results])
        )
        branches = Condensed(
            self._branch,
            LinearisedStages.of(self._branch, self._derivatives, initial[1:], [r[:, horizon:] for r in results]),
        )
        of_plan, of_branches, of_rows = self._programme(nominal, branches, w, bounds)
        dw = nominal.change(of_plan)
        w[:horizon] += dw
        w[horizon:] += branches.change(of_branches).reshape(-1, layout.block)
        of_constraints = np.zeros(len(lam))
        of_constraints[at.stage_rows[:horizon]], of_constraints[at.start] = nominal.multipliers(dw, of_rows)
        return at.of_stages(w), (np.zeros(len(x)), of_constraints)
