"""From an estimate to a plan: what the problem is given, the tries to solve it, and what can not be kept."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Estimate, Sample, Status, full_parameters
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.chance_constraint import ChanceConstraint, quantile_of
from controllers.economic_mpc.modifiers.learning import Modifiers
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.layout import Bounds
from controllers.economic_mpc.problem.stage import Arguments, OutputModifiers
from controllers.economic_mpc.softening import GivenUp, Softening
from controllers.economic_mpc.solvers.verification import NlpSolution, Solver, Validity
from controllers.economic_mpc.state import MpcState
from controllers.economic_mpc.tree.tree_planner import TreePlanner

BRANCH, PROBABILITY = 5, 0.95
"""Defaults of the tree: moves that a branch looks ahead, and what places the outer scenarios."""


@dataclass(frozen=True)
class Found:
    """What the optimisation of one decision came to.

    Attributes
    ----------
    solution
        The last solution, valid or not.
    status
        `OK`, `RETRIED` or `SOFTENED`, if the solution is valid.
    arguments, bounds
        What it was solved with.
    given_up
        Limits that the plan does not keep.
    tree
        Solution for all scenarios; None without a tree.
    note
        What went wrong on the way to a valid solution; empty for nothing.
    """

    solution: NlpSolution
    status: Status
    arguments: FloatArray
    bounds: dict[str, FloatArray]
    given_up: tuple[GivenUp, ...] = ()
    note: str = ""
    tree: NlpSolution | None = None


@dataclass(frozen=True)
class Uncertainty:
    """What is done about what the estimate leaves open; see `EconomicMpc`."""

    limit_probability: float | None
    scenarios: int
    branch: int | None


class Planner:
    """Solves the problem of one decision.

    Parameters
    ----------
    setup
        Of the controller.
    problem, bounds
        The problem of one plan, and its ranges.
    limits, prices
        Values of the output limits, and prices as the problem has them.
    softening
        Order in which limits are given up.
    uncertainty
        What is done about it.
    solver
        Name of the solver.
    budget_s
        Wall-clock time of a solve [s]; there is no further one when it took longer.
    modifiers
        Learns slopes of the plant; None for the model's.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        problem: OptimalControlProblem,
        bounds: Bounds,
        *,
        limits: FloatArray,
        prices: FloatArray,
        softening: Softening,
        uncertainty: Uncertainty,
        solver: str,
        budget_s: float,
        modifiers: Modifiers | None = None,
    ) -> None:
        self._modifiers = modifiers
        self.setup, self.layout, self.softening, self.budget_s = setup, problem.layout, softening, budget_s
        self.bounds = self.layout.bounds(bounds)
        self.limits, self._prices = limits, prices
        self._chance: ChanceConstraint | None = None
        self.tree: TreePlanner | None = None
        asked = uncertainty.limit_probability
        if uncertainty.scenarios != 1:
            self.tree = TreePlanner(
                setup,
                problem,
                scenarios=uncertainty.scenarios,
                branch=min(BRANCH, self.layout.horizon) if uncertainty.branch is None else uncertainty.branch,
                quantile=quantile_of(PROBABILITY if asked is None else asked),
                solver="ipopt" if solver == "ipopt" else "fatrop",
                budget_s=budget_s,
            )
        elif asked is not None:
            self._chance = ChanceConstraint(setup, [e.index for e in self.layout.output_limits], asked)
        self._ode = FastCall(setup.model.ode)

    def find(
        self,
        solver: Solver,
        state: MpcState,
        held: FloatArray,
        sample: Sample,
        estimate: Estimate,
        bounds: dict[str, FloatArray] | None = None,
    ) -> Found:
        """Solve; a failure is a value.

        Parameters
        ----------
        solver
            Finds plans.
        state
            Of the controller.
        held
            Inputs now (nu,), the newest of the disturbances among them.
        sample, estimate
            The newest.
        bounds
            Of the problem, where they are not the usual ones.
        """
        model, moved = self.setup.model, self.layout.moved
        theta = full_parameters(model, self.setup.parameters, estimate.parameters, sample.parameters)
        now = Arguments(
            estimate.state,
            held[moved],
            theta,
            np.delete(held, moved),
            self._limits_for(estimate, held, theta),
            np.array(state.bias),
            self._prices,
            estimate.time,
            self._modified(state),
        )
        bounds, back = self.softening.way_back(self.bounds if bounds is None else bounds, held[moved])
        arguments, spent = now.vector(), 0.0
        scenarios = None if self.tree is None else self.tree.scenarios(now, held, estimate, state)
        if self.tree is not None and scenarios is not None and state.tree is not None and state.age == 0:
            ahead = self.tree.find(now, bounds, state.tree, scenarios)
            given_up = self.softening.given_up(ahead.solution.variables, now.limits)
            if ahead.tree is not None and self.softening.is_in_order(given_up):
                told = Status.SOFTENED if back or given_up else Status.OK
                return Found(ahead.solution, told, arguments, bounds, (*back, *given_up), "", ahead.tree)
            spent = ahead.solution.seconds
        solution, status = self._solve(solver, state, arguments, bounds, held, estimate, theta)
        if solution.validity is not Validity.VALID:
            return Found(solution, status, arguments, bounds)
        given_up, note = self.softening.given_up(solution.variables, now.limits), ""
        tree: NlpSolution | None = None
        if not self.softening.is_in_order(given_up) and solution.seconds <= self.budget_s:
            tried = self.softening.in_order(now, bounds, solution)
            if tried.validity is Validity.VALID:
                solution, given_up = tried, self.softening.given_up(tried.variables, now.limits)
            else:
                solution = replace(solution, seconds=tried.seconds)
                note = "not in the stated order, since a further solve failed"
        elif self.tree is not None and scenarios is not None and spent + solution.seconds <= self.budget_s:
            found = self.tree.find(now, bounds, solution.variables, scenarios)
            spent += found.solution.seconds
            if found.tree is None:
                note = "the nominal plan, since no solution was found for its scenarios"
            else:
                spent += solution.seconds
                solution, tree = replace(found.solution, seconds=0.0), found.tree
                given_up = self.softening.given_up(solution.variables, now.limits)
        solution = replace(solution, seconds=solution.seconds + spent)
        given_up = (*back, *given_up)
        return Found(solution, Status.SOFTENED if given_up else status, arguments, bounds, given_up, note, tree)

    def without_tree(self) -> Planner:
        """The same planner for the estimate alone."""
        plain = copy.copy(self)
        plain.tree = None
        return plain

    def _modified(self, state: MpcState) -> OutputModifiers | None:
        if self._modifiers is None or state.modifiers is None:
            return None
        known = state.modifiers
        return OutputModifiers(self._modifiers.offsets(known), self._modifiers.slopes(known), known.answered)

    def _limits_for(self, estimate: Estimate, held: FloatArray, theta: FloatArray) -> FloatArray:
        """Values of the output limits, moved inwards by what the estimate leaves open."""
        if self._chance is None:
            return self.limits
        kept = self._chance.backoff(estimate.time, estimate.state, held, theta, estimate.covariance)
        inwards = np.array([-1.0 if e.is_upper else 1.0 for e in self.layout.output_limits])
        return self.limits + inwards * kept

    def _solve(
        self,
        solver: Solver,
        state: MpcState,
        now: FloatArray,
        bounds: dict[str, FloatArray],
        held: FloatArray,
        estimate: Estimate,
        theta: FloatArray,
    ) -> tuple[NlpSolution, Status]:
        """Warm from the last plan, then once cold."""
        z = self._ode(estimate.time, estimate.state, held, theta)[3]
        cold = self.layout.start(estimate.state, held[self.layout.moved], z)
        if state.plan is None or state.age > 0:  # what is left of a plan from before a failure is no start
            return solver(now, bounds, cold), Status.OK
        shifted = self.layout.shifted(state.plan)
        multipliers = self.layout.shifted_multipliers(state.multipliers) if state.multipliers else None
        solution = solver(now, bounds, shifted, multipliers)
        if solution.validity is Validity.VALID or solution.seconds > self.budget_s:
            return solution, Status.OK
        return solver(now, bounds, cold), Status.RETRIED
