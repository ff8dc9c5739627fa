"""Where a model leaves its own ranges, of which a fit that can not be made says nothing."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.record import RecordSimulator


def where_it_runs_off(problem: Problem, model: Model) -> str:
    """The state that first leaves its range from the model's own values, and when; empty where none does.

    ``from its own values omega leaves [1, 15] rad/s at 21 s``
    """
    record, unknowns = problem.record, Unknowns(problem, model, (), {}, None, {})
    with np.errstate(all="ignore"):
        states = RecordSimulator(model, record.dt).states(record, unknowns.x0, unknowns.base)
    outside = [~((x >= q.lower) & (x <= q.upper)) for q, x in zip(model.states, states.T, strict=True)]
    first = [int(np.argmax(off)) if off.any() else len(off) for off in outside]
    j = int(np.argmin(first))
    if first[j] == len(states):
        return ""
    q, time = model.states[j], record.time[min(first[j] + 1, len(record) - 1)]  # states are those after the first row
    return f"from its own values {q.name} leaves [{q.lower:g}, {q.upper:g}] {q.unit} at {time:g} s"
