"""The plans of a run: what the controller expected, for reports to hold against what happened."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.loop.loop import Step


def plan_table(model: Model, steps: Sequence[Step]) -> pd.DataFrame:
    """Table of every plan of a run, one row a planned move; empty where the controller makes none.

    Returns
    -------
    DataFrame
        `planned_at_s` (when), `time_s` (end of the move), each moved input during the move by its column, and
        each limited output by its column, as expected at its end.
    """
    columns = {q.name: q.column for q in model.inputs}
    shown = {q.name: q.column for q in model.outputs}
    parts = []
    for before, step in zip([None, *steps], steps, strict=False):
        plan = step.decision.plan
        if plan is None or before is None:  # a plan starts from a sample, and the first decision has none
            continue
        moves = {columns[name]: values for name, values in plan.inputs.items()}
        head = {"planned_at_s": before.plant.sample.time, "time_s": plan.time}
        expected = {shown[name]: values for name, values in plan.outputs.items()}
        parts.append(pd.DataFrame({**head, **moves, **expected}))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
