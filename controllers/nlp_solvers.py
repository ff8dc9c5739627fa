"""NLP solvers by name, and the verification that no solution is used without."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import Enum
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from controllers.collocation import Problem

SOLVERS = ("ipopt", "fatrop")
LARGEST_VIOLATION = 1e-4
"""Largest scaled violation of a constraint or bound with which a solution may be used."""
WORST_SHOWN = 5


class Verdict(Enum):
    """What the verification says of a solution."""

    VALID = "valid"
    NOT_FINITE = "not finite"
    VIOLATED = "a constraint is violated"


@dataclass(frozen=True)
class Solution:
    """A solution of the NLP, verified.

    Attributes
    ----------
    variables
        (n,), scaled.
    multipliers
        Of bounds (n,) and constraints (m,): the next warm start.
    verdict
        Whether it may be used.
    message
        The most violated constraints by name, worst first; empty for a valid solution.
    iterations
        Of the solver.
    seconds
        Wall-clock time.
    """

    variables: FloatArray
    multipliers: tuple[FloatArray, FloatArray]
    verdict: Verdict
    message: str
    iterations: int
    seconds: float


class Solver:
    """One solver for one problem, built once; estimates, prices and bounds are arguments of every call.

    Parameters
    ----------
    problem
        The NLP.
    name
        `ipopt` (warm started) or `fatrop` (exploits the stage structure).
    budget_s
        Wall-clock time after which ipopt stops (soft: ipopt checks it between iterations).

    Raises
    ------
    ModelError
        Unknown solver.
    """

    def __init__(self, problem: Problem, name: str, budget_s: float) -> None:
        if name not in SOLVERS:
            raise ModelError(f"economic_mpc: unknown solver {name!r}; {near_match(name, SOLVERS)}")
        self.problem = problem
        self.name = name
        self._solve = ca.nlpsol("economic_mpc", name, problem.nlp, _options(problem, name, budget_s))

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: tuple[FloatArray, FloatArray] | None = None,
    ) -> Solution:
        """Solve from a start (n,), warm if multipliers are given. Never raises: a failure is a verdict."""
        nothing = np.full(len(start), np.nan)
        if not (np.isfinite(arguments).all() and np.isfinite(start).all()):  # fatrop would not come back from a NaN
            lost = np.full(len(bounds["lbg"]), np.nan)
            return Solution(nothing, (nothing, lost), Verdict.NOT_FINITE, "state or estimate is not finite", 0, 0.0)
        warm = {} if multipliers is None else {"lam_x0": multipliers[0], "lam_g0": multipliers[1]}
        begin = time.perf_counter()
        try:
            found: dict[str, Any] = self._solve(x0=start, p=arguments, **bounds, **warm)
            iterations = int(self._solve.stats().get("iter_count", 0))
            x, lam_x, lam_g = (np.array(found[key]).ravel() for key in ("x", "lam_x", "lam_g"))
        except RuntimeError:  # NaN in a function: some solvers raise
            x, lam_x, lam_g, iterations = nothing, nothing, np.full(len(bounds["lbg"]), np.nan), 0
        seconds = time.perf_counter() - begin
        verdict, message = verify(self.problem, x, arguments, bounds)
        return Solution(x, (lam_x, lam_g), verdict, message, iterations, seconds)


class FailingSolver:
    """Never finds a solution: for drills."""

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: tuple[FloatArray, FloatArray] | None = None,
    ) -> Solution:
        """Fail; see `Solver`."""
        del arguments, multipliers
        nothing, lost = np.full(len(start), np.nan), np.full(len(bounds["lbg"]), np.nan)
        return Solution(nothing, (nothing, lost), Verdict.NOT_FINITE, "the solver was made to fail", 0, 0.0)


def verify(
    problem: Problem, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray]
) -> tuple[Verdict, str]:
    """Check a solution by itself, whatever the solver says: finite, within bounds, constraints met.

    Solvers report infeasible and NaN alike and may return inputs far outside their bounds.
    """
    if not np.isfinite(x).all():
        return Verdict.NOT_FINITE, "the solution is not finite"
    g = np.array(problem.constraints(x, arguments)).ravel()
    over = np.maximum(bounds["lbg"] - g, g - bounds["ubg"])
    outside = float(np.max(np.maximum(bounds["lbx"] - x, x - bounds["ubx"])))
    if not np.isfinite(over).all():
        return Verdict.NOT_FINITE, "a constraint is not finite"
    if max(float(np.max(over)), outside) <= LARGEST_VIOLATION:
        return Verdict.VALID, ""
    worst = np.argsort(over)[::-1][:WORST_SHOWN]
    parts = [f"{problem.names[i]} by {over[i]:.2g}" for i in worst if over[i] > LARGEST_VIOLATION]
    if outside > LARGEST_VIOLATION:
        parts.append(f"a bound by {outside:.2g}")
    return Verdict.VIOLATED, "violated (scaled): " + "; ".join(parts)


def _options(problem: Problem, name: str, budget_s: float) -> dict[str, Any]:
    common: dict[str, Any] = {"expand": True, "print_time": False}
    if name == "fatrop":
        return common | {
            "structure_detection": "auto",
            "equality": problem.equality,
            "fatrop.print_level": 0,
            "fatrop.tol": 1e-6,
            "fatrop.mu_init": 1e-3,
            "fatrop.bound_push": 1e-4,
            "fatrop.bound_frac": 1e-4,
            "fatrop.max_iter": 200,
        }
    push = {f"ipopt.warm_start_{what}": 1e-6 for what in ("bound_push", "bound_frac", "mult_bound_push")}
    slack = {f"ipopt.warm_start_slack_{what}": 1e-6 for what in ("bound_push", "bound_frac")}
    return common | {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-6,
        "ipopt.mu_init": 1e-4,
        "ipopt.warm_start_init_point": "yes",
        "ipopt.max_wall_time": budget_s,
        **push,
        **slack,
    }
