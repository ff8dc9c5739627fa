"""Real-time iterations: one Newton step of sequential quadratic programming a move, from the plan of the move before.

Diehl, Bock and Schloeder (2005), SIAM J. Control Optim. 43(5): the plan follows the optimum as the state changes, and
is not brought to it at any one time. What a step leaves of the equations is verified like every solution; where the
plan was moved too far for one step, further ones follow. The steps are those of one plan (`newton_step.py`) or of a
tree (`tree_step.py`).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Protocol

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.layout import Multipliers
from controllers.economic_mpc.solvers.verification import Nlp, NlpSolution, Solver, Validity, Verifier, no_solution

MOST_STEPS, MOST_TO_OPTIMUM = 4, 12


class NewtonStep(Protocol):
    """One step of sequential quadratic programming; LinAlgError where the equations can not be solved."""

    def __call__(
        self, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray], lam: FloatArray
    ) -> tuple[FloatArray, Multipliers]:
        """Variables and multipliers a step from variables x (n,) with multipliers lam of the constraints (m,)."""
        ...


class RealTimeIteration:
    """Newton steps on one problem; a cold start is left to a complete solver.

    Parameters
    ----------
    problem
        The NLP.
    step
        Its Newton step.
    cold
        Solver of cold starts.
    until
        Largest change of a variable by the last step: a small one gives the optimum. Where `MOST_TO_OPTIMUM` steps do
        not come there, the complete solver begins anew. Default: the first valid plan is taken.
    """

    def __init__(self, problem: Nlp, step: NewtonStep, cold: Solver, until: float = np.inf) -> None:
        self.problem, self._step, self._cold, self._until = problem, step, cold, until
        self._most = MOST_STEPS if until == np.inf else MOST_TO_OPTIMUM
        self._verify = Verifier(problem)

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: Multipliers | None = None,
    ) -> NlpSolution:
        """One step from a start (n,) and its multipliers, more where the equations ask for it; see `Solver`."""
        if multipliers is None or not (np.isfinite(arguments).all() and np.isfinite(start).all()):
            return self._cold(arguments, bounds, start)  # it says what is not finite
        found, change = self._steps(arguments, bounds, start, multipliers)
        if self._until == np.inf or (found.validity is Validity.VALID and change <= self._until):
            return found
        complete = self._cold(arguments, bounds, start)
        return replace(complete, seconds=complete.seconds + found.seconds)

    def _steps(
        self, arguments: FloatArray, bounds: dict[str, FloatArray], start: FloatArray, multipliers: Multipliers
    ) -> tuple[NlpSolution, float]:
        """Steps from a start, and the largest change by the last one."""
        begin, x, lam, steps, change = time.perf_counter(), start, multipliers, 0, np.inf
        validity, message = Validity.VIOLATED, ""
        while steps < self._most and (validity is Validity.VIOLATED or change > self._until):
            before = x
            try:
                x, lam = self._step(x, arguments, bounds, lam[1])
            except np.linalg.LinAlgError as error:  # NaN, or equations that can not be solved for their points
                return no_solution(len(start), len(bounds["lbg"]), str(error), time.perf_counter() - begin), change
            steps += 1
            change = float(np.abs(x - before).max())
            validity, message = self._verify(x, arguments, bounds)
            if validity is Validity.NOT_FINITE:
                break
        return NlpSolution(x, lam, validity, message, steps, time.perf_counter() - begin, "rti"), change
