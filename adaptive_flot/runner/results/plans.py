"""The plans of a run: what the controller expected, for reports to hold against what happened."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from adaptive_flot.contracts import Plan
from adaptive_flot.greybox.model import FloatArray, Model


def plan_table(model: Model, time: FloatArray, plans: Sequence[Plan | None]) -> pd.DataFrame:
    """Table of every plan of a run, one row a planned move; empty where the controller makes none.

    Parameters
    ----------
    model
        Names of the columns.
    time, plans
        End of each interval [s] (N,), and the plan that its decision came with.

    Returns
    -------
    DataFrame
        `planned_at_s` (when), `time_s` (end of the move), each moved input during the move by its column, and
        each limited output by its column, as expected at its end.
    """
    columns = {q.name: q.column for q in model.inputs}
    shown = {q.name: q.column for q in model.outputs}
    parts = []
    # a plan starts from the sample before it, and the first decision has none
    for before, plan in zip(time, plans[1:], strict=False):
        if plan is None:
            continue
        moves = {columns[name]: values for name, values in plan.inputs.items()}
        head = {"planned_at_s": float(before), "time_s": plan.time}
        expected = {shown[name]: values for name, values in plan.outputs.items()}
        parts.append(pd.DataFrame({**head, **moves, **expected}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
