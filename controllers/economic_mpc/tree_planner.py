"""Plans whose first move keeps the limits in every scenario."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Estimate
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.chance_constraint import SteadyGains
from controllers.economic_mpc.collocation import OptimalControlProblem
from controllers.economic_mpc.nlp_solvers import InteriorPoint
from controllers.economic_mpc.scenario_tree import ScenarioTree
from controllers.economic_mpc.scenarios import Scenarios, grid
from controllers.economic_mpc.stage import Arguments
from controllers.economic_mpc.state import MpcState
from controllers.economic_mpc.verification import NlpSolution, Solver, Validity

SIZES = {3: 1, 9: 2, 27: 3}
"""Number of axes by number of scenarios."""


@dataclass(frozen=True)
class TreePlan:
    """The nominal plan of a solved tree, and the variables of all scenarios (S, n)."""

    solution: NlpSolution
    scenarios: FloatArray


class TreePlanner:
    """Solves the tree from the nominal plan.

    Parameters
    ----------
    setup
        Of the controller.
    problem
        The nominal problem.
    scenarios
        3, 9 or 27.
    branch
        Moves of a branch.
    quantile
        Distance of the outer scenarios, in standard deviations.
    solver, budget_s
        `ipopt` or `fatrop`, and its time.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        problem: OptimalControlProblem,
        *,
        scenarios: int,
        branch: int,
        quantile: float,
        solver: str,
        budget_s: float,
    ) -> None:
        if scenarios not in SIZES:
            raise ModelError(f"economic_mpc: scenarios = {scenarios}; give 1, 3, 9 or 27")
        if not 1 <= branch <= problem.layout.horizon:
            raise ModelError(f"economic_mpc: branch = {branch}; give 1 to {problem.layout.horizon}, the horizon")
        self.layout, self.tree = problem.layout, ScenarioTree(problem, scenarios, branch)
        self.solver: Solver = InteriorPoint(self.tree, self.tree.functions(solver), solver, budget_s)
        self._axes, self._quantile = SIZES[scenarios], quantile
        adapted = [setup.model.parameters[i] for i in setup.model.indices("parameters", setup.parameters)]
        self._lowest, self._highest = np.array([[p.lower, p.upper] for p in adapted]).reshape(-1, 2).T
        self._adapted = setup.model.indices("parameters", setup.parameters)
        self._gains = SteadyGains(setup, setup.model.indices("outputs", self.layout.outputs))

    def scenarios(self, now: Arguments, held: FloatArray, estimate: Estimate, state: MpcState) -> Scenarios:
        """Scenarios of a decision; see `scenarios.py`."""
        gains = self._gains(now.time, now.state, held, now.parameters)
        theta, spread = estimate.parameters, np.sqrt(np.array(state.misfit.variance))
        found = grid(theta, estimate.covariance, spread, gains, self._axes, self._quantile)
        inside = np.clip(found.parameters, np.minimum(self._lowest, theta), np.maximum(self._highest, theta))
        return Scenarios(inside, found.biases)

    def find(
        self,
        now: Arguments,
        bounds: dict[str, FloatArray],
        nominal: NlpSolution,
        scenarios: Scenarios,
        before: FloatArray | None,
    ) -> TreePlan | None:
        """Solve; None where no valid solution was found.

        Parameters
        ----------
        now, bounds
            What the nominal plan was solved with.
        nominal
            The valid nominal plan: the start.
        scenarios
            The scenarios.
        before
            Variables of all scenarios of the tree before (S, n), a better start of the branches; None without one.
        """
        branches = [nominal.variables] * self.tree.count
        if before is not None:
            branches[1:] = [self.layout.shifted(each) for each in before[1:]]
        arguments = [now.vector()]
        prices = now.prices.copy()
        prices[: len(prices) - self.layout.slacks_size - 1] = 0.0  # a branch has to keep limits, not to earn
        for theta, bias in zip(scenarios.parameters[1:], scenarios.biases[1:], strict=True):
            p = now.parameters.copy()
            p[self._adapted] = theta
            arguments.append(replace(now, parameters=p, biases=now.biases + bias, prices=prices).vector())
        solution = self.solver(np.concatenate(arguments), self.tree.bounds(bounds), self.tree.joined(branches))
        if solution.validity is not Validity.VALID:
            return None
        found = np.array(self.tree.split(solution.variables))
        seconds = nominal.seconds + solution.seconds
        return TreePlan(
            replace(nominal, variables=found[0], seconds=seconds, found_by=f"tree, {solution.found_by}"), found
        )
