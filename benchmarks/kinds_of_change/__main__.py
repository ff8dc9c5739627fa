"""Run and print: `python -m benchmarks.kinds_of_change`, an hour for 20 seeds on a busy machine.

Writes one Parquet part for each truth, seed and estimator into the folder of `--out`. Parts that are there already are
not run again, so that a run that was stopped goes on; remove the folder after a change. Choices were made on seeds 1 to
3.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.data.tables import read_table, write_table
from benchmarks.kinds_of_change.figures import ESTIMATORS, figures
from benchmarks.kinds_of_change.truths import TRUTHS

AT_ONCE = 5
"""Seeds of a truth that are run in turn: what they have in common is built once."""


GRADE = "concentrate_grade"
PLANTS, BEST = ("n", "C", GRADE), ("n_best", "C_best", GRADE)
"""Fits that are shown: n and C against the plant's own, or against the best-fitting ones."""


def shown(rows: pd.DataFrame, keys: Sequence[str]) -> str:
    """Median fits of n / C / grade, and the mean share of the time that is held."""
    fits = " / ".join(f"{rows[key].median():.{2 if key == GRADE else 1}f}" for key in keys)
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
    truths = options.truth or TRUTHS
    parts = {
        (key, seed, name): options.out / f"{key}-seed{seed}-{name}.parquet"
        for seed in seeds
        for key in truths
        for name in estimators
    }
    jobs = [(key, seeds[i : i + AT_ONCE]) for i in range(0, len(seeds), AT_ONCE) for key in truths]
    for key, some in track(jobs, "kinds of change", console=Console(stderr=True)):
        for name in estimators:
            missing = [seed for seed in some if not parts[key, seed, name].is_file()]
            if missing:
                found = figures(TRUTHS[key], key, missing, [name], options.out, compiled=options.compile)
                for seed, row in found.groupby("seed"):
                    write_table(row, parts[key, int(str(seed)), name])
    rows = pd.concat([read_table(part) for part in parts.values()], ignore_index=True)
    title = f"Fits of n / C / grade (medians), share of the time held (mean); seeds {seeds[0]} to {seeds[-1]}"
    table = Table("truth", *estimators, "told: model error", title=title)
    for key in dict.fromkeys(rows["truth"]):
        of = rows[rows["truth"] == key]
        told = float(of[of["estimator"] == estimators[-1]]["model_error"].mean())
        truth = TRUTHS[key]
        for keys, words in ((PLANTS, truth.words), (BEST, "... against the best-fitting n and C")):
            if keys is PLANTS or not truth.has_true_parameters:
                cells = [shown(of[of["estimator"] == name], keys) for name in estimators]
                table.add_row(words, *cells, f"{told:.0%}")
    Console(width=None if Console().is_terminal else 220).print(table)


if __name__ == "__main__":
    main()
