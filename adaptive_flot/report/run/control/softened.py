"""Table of the limits that no plan kept: which were given up, when, how often and how far."""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.greybox.model import Model
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.timeseries import SOFTENED


def softened_table(model: Model, runs: Sequence[Run]) -> Table | None:
    """Limits that plans of these runs gave up, a row each; None where every plan kept every limit."""
    quantities = {q.name: q for kind in (model.inputs, model.states, model.outputs) for q in kind}
    rows = []
    for run in runs:
        for column in (c for c in run.table if str(c).startswith(SOFTENED)):
            excess = run.table[column].dropna()
            if excess.empty:
                continue
            name = str(column).removeprefix(SOFTENED)
            unit = quantities[name].unit if name in quantities else ""
            largest = f"{excess.max():.3g}{'' if unit in ('', '-') else ' ' + unit}"
            first = number(run.table["time_s"][excess.index[0]], "g")
            rows.append((run.controller, run.estimator, str(run.seed), name, first, str(len(excess)), largest))
    if not rows:
        return None
    caption = (
        "Limits that no plan kept, given up in the controller's stated order, and how far a plan went beyond each at "
        "most."
    )
    header = ("Controller", "Estimator", "Seed", "Limit of", "First at [s]", "Times", "Beyond it by")
    return Table(caption, header, tuple(rows), words=len(header))
