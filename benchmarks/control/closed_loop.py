"""Every closed-loop scenario with every controller over ten seeds: `python -m benchmarks.control.closed_loop`.

Runs in two processes (`--processes`) and writes one Parquet part for each scenario and seed into the folder of `--out`
(default `results/closed_loop`). Parts that are there already are not run again, so that a run that was stopped goes on;
remove the folder after a change. Prints what was asked of the closed loop and what was reached; `adaptive-flot compare
results/closed_loop` shows the same runs in full. `python -m benchmarks.pictures.readme_table
results/closed_loop` puts them into `docs/results/closed_loop.md`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.commands.comparison import Comparison, Contender, compare
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import run_summary
from adaptive_flot.runner.commands.runs.runs_table import read_runs, run_rows
from adaptive_flot.runner.scenario.loading import load_scenario
from benchmarks.timing.speed import Figure

SCENARIOS = (
    "closed_loop_drift",
    "closed_loop_drift_down",
    "feed_disturbance",
    "feed_disturbance_unmeasured",
    "start_up",
    "faults",
)
SEEDS = 10
PROCESSES = 2
MPC, ADAPTIVE = "economic_mpc", DEFAULT_ESTIMATOR
LONGEST_BELOW = 0.01
"""Share of the time that may be below the grade limit."""
LEAST_SHARE = 0.95
"""Share of the oracle's gain over fixed parameters that adaptation must recapture."""


def run_part(name: str, seed: int, part: Path) -> None:
    """Run all cases of a scenario for one seed and write their rows."""
    scenario = load_scenario(name)
    write_table(pd.DataFrame(run_rows(run_summary(scenario, run_scenario(scenario, seeds=[seed])))), part)


def run_missing(folder: Path, scenarios: Sequence[str], seeds: Sequence[int], processes: int) -> None:
    """Run what has no part yet."""
    parts = {(name, seed): folder / f"{name}-seed{seed}.parquet" for seed in seeds for name in scenarios}
    missing = {key: part for key, part in parts.items() if not part.is_file()}
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # two processes of one thread each
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(run_part, name, seed, part) for (name, seed), part in missing.items()]
        for job in track(as_completed(jobs), "closed loop", total=len(jobs), console=Console(stderr=True)):
            job.result()


def figures(comparison: Comparison) -> Iterator[Figure]:
    """What was asked of the economic MPC with the default estimator in one scenario, and reached: medians of seeds."""
    contenders = {(c.controller, c.estimator): c for c in comparison.contenders}
    adaptive = contenders.get((MPC, ADAPTIVE))
    if adaptive is None:
        return
    name = comparison.scenario
    share = comparison.share(adaptive, "value_cu_h")
    if np.isfinite(share).any():
        median = float(np.nanmedian(share))
        met = median >= LEAST_SHARE
        yield Figure(f"{name}: share of the oracle's gain over fixed", f"{median:.1%}", f">= {LEAST_SHARE:.0%}", met)
    below = adaptive.spread("below_limit")
    fixed = contenders.get((MPC, "fixed"))
    beside = f" (fixed {fixed.spread('below_limit').median:.2%})" if fixed else ""
    shown = f"{below.median:.2%} [{below.low:.2%}, {below.high:.2%}]{beside}"
    yield Figure(f"{name}: time below the limit", shown, f"<= {LONGEST_BELOW:.0%}", below.median <= LONGEST_BELOW)
    if ("pi", "fixed") in contenders:
        gain = _paired(adaptive, contenders["pi", "fixed"])
        yield Figure(
            f"{name}: value over PI, smallest over the seeds", f"{gain.min():+.3f} cu/h", "> 0", gain.min() > 0
        )


def _paired(one: Contender, other: Contender) -> pd.Series[float]:
    """Difference in value by seed [cu/h]."""
    difference: pd.Series[float] = (one.runs["value_cu_h"] - other.runs["value_cu_h"]).dropna()
    return difference


def main() -> None:
    """Run what is missing and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/closed_loop"))
    parser.add_argument("--scenario", action="append", choices=SCENARIOS, help="repeatable; default all")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds, from 1 on")
    parser.add_argument("--processes", type=int, default=PROCESSES)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    run_missing(options.out, options.scenario or SCENARIOS, range(1, options.seeds + 1), options.processes)
    comparisons = compare(read_runs([options.out]))
    counts = sorted({len(c.seeds) for comparison in comparisons for c in comparison.contenders})
    table = Table("figure", "measured", "asked", "met", title=f"{MPC} with {ADAPTIVE}, seeds: {counts}")
    for figure in (f for comparison in comparisons for f in figures(comparison)):
        table.add_row(figure.what, figure.measured, figure.limit, "yes" if figure.met else "no")
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
