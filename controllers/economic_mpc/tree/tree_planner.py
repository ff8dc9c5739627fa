"""Plans whose first move keeps the limits in every scenario."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Estimate
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.chance_constraint import SteadyGains
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.stage import Arguments
from controllers.economic_mpc.scenarios import Scenarios, grid
from controllers.economic_mpc.solvers.nlp_solvers import InteriorPoint
from controllers.economic_mpc.solvers.real_time_iteration import RealTimeIteration
from controllers.economic_mpc.solvers.verification import NlpSolution, Solver, Validity
from controllers.economic_mpc.state import MpcState
from controllers.economic_mpc.tree.scenario_tree import ScenarioTree
from controllers.economic_mpc.tree.tree_step import TreeStep

SIZES = {3: 1, 9: 2, 27: 3}
"""Number of axes by number of scenarios."""


@dataclass(frozen=True)
class TreePlan:
    """The nominal plan of a tree, and the solution of all scenarios; None where that is not valid."""

    solution: NlpSolution
    tree: NlpSolution | None


class TreePlanner:
    """Solves the tree.

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
        cold = InteriorPoint(self.tree, self.tree.functions(solver), solver, budget_s)
        self.solver: Solver = cold if solver == "ipopt" else RealTimeIteration(self.tree, TreeStep(self.tree), cold)
        self._axes, self._quantile = SIZES[scenarios], quantile
        adapted = [setup.model.parameters[i] for i in setup.model.indices("parameters", setup.parameters)]
        self._lowest, self._highest = np.array([[p.lower, p.upper] for p in adapted]).reshape(-1, 2).T
        self._by_factor = [p.varies_by_factor for p in adapted]
        self._adapted = setup.model.indices("parameters", setup.parameters)
        self._gains = SteadyGains(setup, setup.model.indices("outputs", self.layout.outputs))

    def scenarios(self, now: Arguments, held: FloatArray, estimate: Estimate, state: MpcState) -> Scenarios | None:
        """Scenarios of a decision, see `scenarios.py`; None where they are all alike, or not finite."""
        gains = self._gains(now.time, now.state, held, now.parameters)
        theta, spread = estimate.parameters, np.sqrt(np.array(state.misfit.variance))
        if not (np.isfinite(estimate.covariance).all() and np.isfinite(theta).all()):
            return None
        found = grid(theta, estimate.covariance, spread, gains, self._axes, self._quantile, self._by_factor)
        inside = np.clip(found.parameters, np.minimum(self._lowest, theta), np.maximum(self._highest, theta))
        scenarios = Scenarios(inside, found.biases)
        return None if scenarios.are_alike else scenarios

    def find(
        self, now: Arguments, bounds: dict[str, FloatArray], start: FloatArray | NlpSolution, scenarios: Scenarios
    ) -> TreePlan:
        """Solve; a failure is a value.

        Parameters
        ----------
        now, bounds
            What a nominal plan is solved with.
        start
            The nominal plan (n,), or the tree of the move before.
        scenarios
            The scenarios.
        """
        arguments = [now.vector()]
        prices = now.prices.copy()
        prices[: len(prices) - self.layout.slacks_size - 1] = 0.0  # a branch has to keep limits, not to earn
        for theta, bias in zip(scenarios.parameters[1:], scenarios.biases[1:], strict=True):
            p = now.parameters.copy()
            p[self._adapted] = theta
            arguments.append(replace(now, parameters=p, biases=now.biases + bias, prices=prices).vector())
        at, multipliers = self.tree.at, None
        if isinstance(start, NlpSolution):
            first, multipliers = at.shifted(start.variables), at.shifted_multipliers(start.multipliers)
        else:
            first = at.joined([start] * at.count)
        solution = self.solver(np.concatenate(arguments), at.bounds(bounds), first, multipliers)
        no_multipliers = np.zeros(self.layout.size), np.zeros(len(bounds["lbg"]))
        nominal = replace(solution, variables=at.split(solution.variables)[0], multipliers=no_multipliers)
        return TreePlan(nominal, solution if solution.validity is Validity.VALID else None)
