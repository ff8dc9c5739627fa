"""Whether inputs act one row later than a record says: a matter of how it was logged, and no effect of the plant.

An input in a row acts before that row. Many loggers write an input with what was measured when it was given: it acts
after that row. A model of a fast process is then one row early, which lags and curves of the inputs stand in for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.moved_inputs import with_inputs_moved
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import State, Verdict
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import LATE, Effect
from adaptive_flot.greybox.forms.form import CoefficientRole

AS_GOOD = 1.05
"""Inputs are moved where that alone leaves at most so many times the error of what is told,"""
BETTER = 0.7
"""and at most so many times the error of the model as it is: geometric means over the outputs."""
MOST_ROWS = 2.0
"""Rows from which what is late comes later than a row for sure."""


def with_later_inputs(state: State, verdict: Verdict) -> Dataset | None:
    """The record with its inputs moved down by one row, where that explains as much as what was found; else None.

    What was found stays, but for lags and dead times. One of more than a row explains more than the moved inputs, and
    is told. One of a row looks the same.
    """
    if verdict.word in ("none", "insufficient") or state.base is None or state.after is None:
        return None
    problem = state.known_problem
    if problem.background is not None or problem.time_is_up or state.report_record is not None:
        return None
    if not any(_is_about_a_row(e, state) for e in state.after.model.fitted_effects()):
        return None
    moved = with_inputs_moved(problem.record)
    there = replace(problem, record=moved, nodes=None)
    base, after = state.base, state.after
    prompt = [e for e in after.model.fitted_effects() if e.driver not in LATE]
    tried = [Fitter(there).fit(base.model, like=base, rounds=2)]
    if prompt and len(prompt) < len(after.model.effects):
        model = after.model.without_effects().with_effects(prompt)
        free = [n for n in after.names if n in model.names("parameters")]
        tried.append(Fitter(there).fit(model, tuple(free), like=after, rounds=2))
    late = min((_error(problem, f) for f in tried if f is not None), default=float("inf"))
    plain, told = (_error(problem, f) for f in (state.before or base, after))
    if late > AS_GOOD * told or late > BETTER * plain:
        return None
    return moved


def _is_about_a_row(effect: Effect, state: State) -> bool:
    """Whether inputs that act a row later may be taken for an effect: a dependence on one of them, or a short lag."""
    if effect.values(CoefficientRole.READING):
        return False
    if effect.driver in LATE:
        late = effect.values(CoefficientRole.TIME_CONSTANT, CoefficientRole.DEAD_TIME)
        return max(late, default=0.0) < MOST_ROWS * state.known_problem.record.dt
    return effect.driver in state.model.names("inputs")


def _error(problem: Problem, fit: Fit) -> float:
    """Geometric mean over the outputs of the root mean square error, on all rows of any split."""
    error = np.sqrt(np.nanmean(fit.residual(problem)[problem.rows()] ** 2, axis=0))
    return float(np.exp(np.mean(np.log(np.maximum(error, 1e-300)))))
