"""The verification that no solution is used without."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.problem.layout import Multipliers

LARGEST_VIOLATION = 1e-4
"""Largest scaled violation of a constraint or bound with which a solution may be used."""
WORST_SHOWN = 5


class Validity(Enum):
    """What the verification says of a solution."""

    VALID = "valid"
    NOT_FINITE = "not finite"
    VIOLATED = "a constraint is violated"


@dataclass(frozen=True)
class NlpSolution:
    """A solution of the NLP, verified.

    Attributes
    ----------
    variables
        (n,), scaled.
    multipliers
        Of bounds (n,) and constraints (m,): the next warm start.
    validity
        Whether it may be used.
    message
        The most violated constraints by name, worst first; empty for a valid solution.
    iterations
        Of the solver.
    seconds
        Wall-clock time.
    found_by
        Name of the solver.
    """

    variables: FloatArray
    multipliers: Multipliers
    validity: Validity
    message: str
    iterations: int
    seconds: float
    found_by: str = ""


def no_solution(size: int, constraints: int, message: str, seconds: float = 0.0) -> NlpSolution:
    """What a solver returns that found nothing: NaN for variables (size,) and multipliers."""
    nothing, lost = np.full(size, np.nan), np.full(constraints, np.nan)
    return NlpSolution(nothing, (nothing, lost), Validity.NOT_FINITE, message, 0, seconds)


class Nlp(Protocol):
    """What solvers and the verification know of a problem: that of one plan, or of a tree of them."""

    nlp: dict[str, Any]
    names: list[str]
    equality: list[bool]
    structure: dict[str, Any]
    constraints: ca.Function

    def physical(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of each variable (n,)."""
        ...


class Solver(Protocol):
    """Finds a plan. Never raises: a failure is a value."""

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: Multipliers | None = None,
    ) -> NlpSolution:
        """Solve from a start (n,), warm if multipliers are given; arguments as in `stage.Arguments.vector`."""
        ...


class Verifier:
    """Checks a solution by itself, whatever the solver says: finite, within bounds, constraints met.

    Solvers report infeasible and NaN alike and may return inputs far outside their bounds.
    """

    def __init__(self, problem: Nlp) -> None:
        self.names = problem.names
        self._constraints = FastCall(problem.constraints)
        self._lowest, self._highest = problem.physical()

    def __call__(self, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray]) -> tuple[Validity, str]:
        """Validity of variables (n,), and in words what is wrong."""
        if not np.isfinite(x).all():
            return Validity.NOT_FINITE, "the solution is not finite"
        (g,) = self._constraints(x, arguments)
        over = np.maximum(bounds["lbg"] - g, g - bounds["ubg"])
        if not np.isfinite(g).all():
            return Validity.NOT_FINITE, "a constraint is not finite"
        low, high = np.maximum(bounds["lbx"], self._lowest), np.minimum(bounds["ubx"], self._highest)
        outside = float(np.max(np.maximum(low - x, x - high)))
        if max(float(np.max(over)), outside) <= LARGEST_VIOLATION:
            return Validity.VALID, ""
        worst = np.argsort(over)[::-1][:WORST_SHOWN]
        parts = [f"{self.names[i]} by {over[i]:.2g}" for i in worst if over[i] > LARGEST_VIOLATION]
        if outside > LARGEST_VIOLATION:
            parts.append(f"a bound by {outside:.2g}")
        return Validity.VIOLATED, "violated (scaled): " + "; ".join(parts)
