"""What a decision tells of its plan."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from adaptive_flot.contracts import Plan
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.planner import Found
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.softening import by_name, in_words


class Told(NamedTuple):
    """The plan, words on it, and how far beyond each limit it goes."""

    plan: Plan
    words: str
    softened: Mapping[str, float]


class Teller:
    """Tells plans of a problem in units."""

    def __init__(self, problem: OptimalControlProblem) -> None:
        self.layout = problem.layout
        self._outputs = FastCall(problem.outputs, matrices=("outputs",))

    def __call__(self, time: float, found: Found) -> Told:
        """What was found, valid, at a time [s]."""
        solution = found.solution
        inputs = self.layout.inputs_of(solution.variables)
        ends = time + self.layout.move_s * np.arange(1.0, self.layout.horizon + 1)
        (outputs,) = self._outputs(solution.variables, found.arguments)
        moves = dict(zip(self.layout.moved_names, inputs.T, strict=True))
        plan = Plan(ends, moves, dict(zip(self.layout.outputs, outputs.T, strict=True)))
        words = "; ".join(part for part in (in_words(found.given_up), found.note) if part)
        return Told(plan, words, by_name(found.given_up))
