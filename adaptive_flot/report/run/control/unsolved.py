"""Table of the optimisations without a valid solution: when, who decided then, and what was in the way."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from adaptive_flot.contracts import Status
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number
from adaptive_flot.runner.commands.runs.run_result import Run

MOST_ROWS = 10


def unsolved_table(runs: Sequence[Run]) -> Table | None:
    """Failed optimisations of runs, those of a run with the same words in one row; None where all were solved."""
    rows = [row for run in runs for row in _rows(run)]
    if not rows:
        return None
    caption = (
        "Optimisations without a valid solution: what was wrong (the most violated constraints, worst first), and who "
        "decided instead."
    )
    if len(rows) > MOST_ROWS:
        caption += f" {len(rows) - MOST_ROWS} further rows are in the time series, column control_message."
    header = ("Controller", "Estimator", "Seed", "Decided by", "First at [s]", "Times", "What was wrong")
    return Table(caption, header, tuple(rows[:MOST_ROWS]), words=len(header))


def _rows(run: Run) -> list[tuple[str, ...]]:
    if "control_message" not in run.table:
        return []
    told = run.table["control_message"].fillna("") != ""
    failed = run.table[told & (run.table["control_status"] != Status.SOFTENED.name.lower())]
    groups: pd.DataFrame = failed.groupby(["decided_by", "control_message"], sort=False)["time_s"].agg(["min", "size"])
    return [
        (run.controller, run.estimator, str(run.seed), str(who), number(first, "g"), str(count), str(words))
        for (who, words), first, count in zip(groups.index, groups["min"], groups["size"], strict=True)
    ]
