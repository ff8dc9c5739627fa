"""What freezing is worth in a closed loop that starves the estimator: `python -m benchmarks.control.freezing`.

The economic MPC holds its inputs at constraints in `closed_loop_drift_down`, and the grade then says little about n and
C apart. Three estimators in the loop, five seeds each; takes about a minute a run.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario

SCENARIO, CONTROLLER = "closed_loop_drift_down", "economic_mpc"
SEEDS = tuple(range(1, 6))
VARIANTS = {
    "rpem, forgetting 0.98": Plugin(use="rpem", options={"forgetting": 0.98}),
    "rpem_full, never frozen": Plugin(use="rpem_full", options={"freeze_s": None}),
    "rpem_full": Plugin(use="rpem_full"),
}


def spread(values: list[float], digits: int) -> str:
    """Median, and [lowest, highest] of several."""
    shown = f"{np.median(values):.{digits}f}"
    return shown if len(values) == 1 else f"{shown} [{min(values):.{digits}f}, {max(values):.{digits}f}]"


def row(runs: list[Run]) -> list[str]:
    """Cells of one variant: fits, share of samples with low information, economics."""
    fits = [spread([run.fit[key] for run in runs], 2) for key in runs[0].fit]
    low = [100 * run.status_counts.get("low_information", 0) / len(run.table) for run in runs]
    value = spread([run.account["value_cu_h"] for run in runs], 3)
    return [*fits, spread(low, 0), value, spread([100 * run.account["below_limit"] for run in runs], 2)]


def main() -> None:
    """Measure and print."""
    scenario = load_scenario(SCENARIO)
    scenario = replace(scenario, file=scenario.file.model_copy(update={"estimators": VARIANTS, "cases": []}))
    jobs = [(seed, name) for seed in SEEDS for name in VARIANTS]
    runs_of: dict[str, list[Run]] = {name: [] for name in VARIANTS}
    done = Console(stderr=True)
    for seed, name in jobs:
        runs_of[name] += run_scenario(scenario, [name], [seed], controllers=[CONTROLLER])
        done.print(f"seed {seed}, {name}: {', '.join(row(runs_of[name][-1:]))}", soft_wrap=True)
    table = Table("estimator", title=f"{SCENARIO}, {CONTROLLER}, seeds {SEEDS[0]} to {SEEDS[-1]}: median and range")
    for column in (*next(iter(runs_of.values()))[0].fit, "low information %", "value cu/h", "below limit %"):
        table.add_column(column, justify="right")
    for name, runs in runs_of.items():
        table.add_row(name, *row(runs))
    Console(width=None if Console().is_terminal else 180).print(table)


if __name__ == "__main__":
    main()
