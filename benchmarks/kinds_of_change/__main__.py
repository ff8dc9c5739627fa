"""Run and print: `python -m benchmarks.kinds_of_change`, an hour for 20 seeds on a busy machine.

Writes one Parquet part for each truth, seed and estimator into the folder of `--out`. Parts that are there already are
not run again, so that a run that was stopped goes on; remove the folder after a change. Choices were made on seeds 1 to
3.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.data.tables import read_table, write_table
from benchmarks.kinds_of_change.figures import ESTIMATORS, figures
from benchmarks.kinds_of_change.truths import TRUTHS


def shown(rows: pd.DataFrame) -> str:
    """Median fits of n / C / grade, and the mean share of the time that is held."""
    fits = " / ".join(f"{rows[key].median():.1f}" for key in ("n", "C", "concentrate_grade"))
    share = float(np.mean(rows["held"]))
    return fits if np.isnan(share) else f"{fits}, {share:.0%}"


def main() -> None:
    """Run what is missing and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/kinds_of_change"))
    parser.add_argument("--truth", action="append", choices=TRUTHS, help="repeatable; default all")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=20, help="number of seeds")
    parser.add_argument("--compile", action="store_true", help="step and estimators as machine code, the same numbers")
    parser.add_argument("--estimator", action="append", choices=ESTIMATORS, help="repeatable; default all")
    options = parser.parse_args()
    estimators = tuple(options.estimator or ESTIMATORS)
    options.out.mkdir(parents=True, exist_ok=True)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    jobs = [(key, seed) for seed in seeds for key in options.truth or TRUTHS]
    parts = {(*job, name): options.out / f"{job[0]}-seed{job[1]}-{name}.parquet" for job in jobs for name in estimators}
    for key, seed in track(jobs, "kinds of change", console=Console(stderr=True)):
        missing = tuple(name for name in estimators if not parts[key, seed, name].is_file())
        if missing:
            found = figures(TRUTHS[key], key, seed, missing, options.out, compiled=options.compile)
            for name, rows in found.groupby("estimator"):
                write_table(rows, parts[key, seed, str(name)])
    rows = pd.concat([read_table(part) for part in parts.values()], ignore_index=True)
    title = f"Fits of n / C / grade (medians), share of the time held (mean); seeds {seeds[0]} to {seeds[-1]}"
    table = Table("truth", *estimators, "told: model error", title=title)
    for key in dict.fromkeys(rows["truth"]):
        of = rows[rows["truth"] == key]
        told = float(of[of["estimator"] == estimators[-1]]["model_error"].mean())
        cells = [shown(of[of["estimator"] == name]) for name in estimators]
        table.add_row(TRUTHS[key].words, *cells, f"{told:.0%}")
    Console(width=None if Console().is_terminal else 220).print(table)


if __name__ == "__main__":
    main()
