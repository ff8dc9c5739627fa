"""`make demo`: the paper's two scenarios, 20 seeds each, as a table beside the published fits and an HTML report."""

from __future__ import annotations

import time
from pathlib import Path

from adaptive_flot.console.lines import print_fits, progress_bar
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.parallel import available_processes
from adaptive_flot.report.run.page import write_run_report
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import run_summary, write_json
from adaptive_flot.runner.scenario.loading import load_scenario

SCENARIOS = ("paper_scenario_1", "paper_scenario_2", "paper_scenario_1_step", "paper_scenario_2_step")
SEEDS = tuple(range(1, 21))
FOLDER = Path("results") / "demo"


def main() -> None:
    """Run, print, write; results go to results/demo."""
    begin = time.perf_counter()
    scenarios = [load_scenario(name) for name in SCENARIOS]
    if compiler_problem() is None:  # the same numbers to rounding, in a quarter of the time
        scenarios = [s.compiled() for s in scenarios]
    runs_each = [len(s.file.estimators) * len(SEEDS) for s in scenarios]
    print(f"The paper's scenarios with ramps and with steps, {len(SEEDS)} seeds: {sum(runs_each)} runs")
    with progress_bar("runs", sum(runs_each)) as advance:
        results = [(s, run_scenario(s, seeds=SEEDS, progress=advance)) for s in scenarios]
    write_json(FOLDER / "summary.json", [run_summary(s, runs) for s, runs in results])
    write_run_report(results, FOLDER / "report.html", command="make demo", processes=available_processes())
    print_fits(results)
    print(f"{time.perf_counter() - begin:.0f} s. Report: {(FOLDER / 'report.html').resolve()}")


if __name__ == "__main__":
    main()
