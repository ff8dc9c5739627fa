"""NLP solvers by name: real-time iterations (`real_time_iteration.py`), and interior-point methods of CasADi.

These are warm started from the plan of the move before. Both follow the central path only down to a small barrier
parameter and stop there. What is left of the barrier costs less than 1e-5 of the objective and keeps the next start
well inside the feasible set: ipopt, which takes the multipliers of the move before, needs 6 iterations instead of 14;
fatrop, which can not take them, 6 instead of 20.
"""

from __future__ import annotations

import time
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.derivatives import Assembled
from controllers.economic_mpc.problem.layout import Multipliers
from controllers.economic_mpc.solvers.newton_step import PlanStep
from controllers.economic_mpc.solvers.real_time_iteration import RealTimeIteration
from controllers.economic_mpc.solvers.verification import Nlp, NlpSolution, Solver, Verifier, no_solution

BARRIER = {"ipopt": 2e-5, "fatrop": 2e-4}
"""Barrier parameter in units of the objective (see `Economics.typical_rate`). A larger one for fatrop would save
an iteration, but then plans are not exact enough to tell what a dip of an input costs (`probing/`)."""
SOLVERS = ("ipopt", "fatrop", "rti")


def make_solver(problem: OptimalControlProblem, name: str, budget_s: float) -> Solver:
    """Build a solver by its name.

    Raises
    ------
    ModelError
        Unknown solver.
    """
    if name not in SOLVERS:
        raise ModelError(f"economic_mpc: unknown solver {name!r}; {near_match(name, SOLVERS)}")
    if name == "rti":
        return RealTimeIteration(problem, PlanStep(problem), interior_point(problem, "fatrop", budget_s))
    return interior_point(problem, name, budget_s)


def interior_point(problem: OptimalControlProblem, name: str, budget_s: float) -> InteriorPoint:
    """`ipopt` or `fatrop` for the problem of one plan."""
    return InteriorPoint(problem, Assembled(problem).functions(name), name, budget_s)


class InteriorPoint:
    """One solver for one problem, built once; estimates, prices and bounds are arguments of every call.

    Parameters
    ----------
    problem
        The NLP.
    derivatives
        Its derivatives, by the names of the solver option `cache`.
    name
        `ipopt` or `fatrop` (exploits the stage structure).
    budget_s
        Wall-clock time after which ipopt stops (soft: ipopt checks it between iterations; fatrop counts iterations).
    """

    def __init__(self, problem: Nlp, derivatives: dict[str, ca.Function], name: str, budget_s: float) -> None:
        self.problem = problem
        self.name = name
        options = _ipopt(budget_s) if name == "ipopt" else _fatrop(problem)
        common: dict[str, Any] = {
            "cache": derivatives,
            "print_time": False,
            "error_on_fail": False,
        }
        # called through its buffers: a plain call converts every argument, and allocates
        self._solve = FastCall(ca.nlpsol("economic_mpc", name, problem.nlp, {**common, **options}))
        self._verify = Verifier(problem)

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: Multipliers | None = None,
    ) -> NlpSolution:
        """Solve from a start (n,), warm if multipliers are given. Never raises: a failure is a value."""
        m = len(bounds["lbg"])
        if not (np.isfinite(arguments).all() and np.isfinite(start).all()):  # fatrop would not come back from a NaN
            return no_solution(len(start), m, "state or estimate is not finite")
        lam_x, lam_g = (np.zeros(len(start)), np.zeros(m)) if multipliers is None else multipliers
        begin = time.perf_counter()
        x, _, _, lam_x, lam_g, _ = self._solve(
            start, arguments, bounds["lbx"], bounds["ubx"], bounds["lbg"], bounds["ubg"], lam_x, lam_g
        )
        seconds = time.perf_counter() - begin
        validity, message = self._verify(x, arguments, bounds)
        iterations = int(self._solve.stats().get("iter_count", 0))
        return NlpSolution(x, (lam_x, lam_g), validity, message, iterations, seconds, self.name)


class FailingSolver:
    """Never finds a solution: for drills."""

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: Multipliers | None = None,
    ) -> NlpSolution:
        """Fail; see `Solver`."""
        del arguments, multipliers
        return no_solution(len(start), len(bounds["lbg"]), "the solver was made to fail")


def _fatrop(problem: Nlp) -> dict[str, Any]:
    return {
        **problem.structure,
        "equality": problem.equality,
        "fatrop.print_level": 0,
        "fatrop.tol": 50 * BARRIER["fatrop"],  # what is left of the barrier counts as an error
        "fatrop.compl_inf_tol": 1.0,
        "fatrop.barrier_tol_factor": 9.0,
        "fatrop.mu_init": BARRIER["fatrop"],
        "fatrop.bound_push": 1e-3,
        "fatrop.bound_frac": 1e-3,
        "fatrop.lam_max": 1e8,
        "fatrop.max_iter": 100,  # kept: with 5, a solve ends after 5 and its plan is not valid
    }


def _ipopt(budget_s: float) -> dict[str, Any]:
    push = {f"ipopt.warm_start_{what}": 1e-6 for what in ("bound_push", "bound_frac", "mult_bound_push")}
    slack = {f"ipopt.warm_start_slack_{what}": 1e-6 for what in ("bound_push", "bound_frac")}
    return {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-5,
        "ipopt.mu_init": BARRIER["ipopt"],
        "ipopt.mu_target": BARRIER["ipopt"],
        "ipopt.warm_start_init_point": "yes",
        "ipopt.max_wall_time": budget_s,
        # the problem comes scaled: what MUMPS does to scale it again takes an eighth of the time
        "ipopt.mumps_permuting_scaling": 0,
        "ipopt.mumps_scaling": 0,
        "ipopt.min_refinement_steps": 0,
        **push,
        **slack,
    }
