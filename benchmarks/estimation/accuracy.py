"""How accurate and how honest each estimator is over many seeds: `python -m benchmarks.estimation.accuracy`.

Both paper scenarios with ramps, the grade alone, every estimator with its defaults. Writes one Parquet part for each
scenario, estimator and seed into the folder of `--out` (default `results/accuracy`); parts that are there are not run
again, so that what was stopped goes on; remove the folder after a change. Prints the fits beside what was asked, and:

- *error / bound*: root mean square error over runs and times, over that of the posterior Cramer-Rao bound of one who
  is told when the parameters turn (a bound is one of the mean over many runs, not of each); the row `bound` has the
  fits of errors that large;
- the consistency: the normalised estimation error squared (NEES) of n and C, whose mean over the runs should lie within
  its 95 % band (Bar-Shalom, Li & Kirubarajan 2001, section 5.4.2). Over so many runs even a small bias leaves the band,
  so the share of samples of single runs below their own 95 % limit is shown too.

`--scenario random_walk --estimator ekf --estimator bound` is the same for truths that walk, where an error within 1.3
times the bound is asked.
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
from scipy.stats import chi2

from adaptive_flot.greybox.data.tables import read_table, write_table
from adaptive_flot.metrics import normalised_error_squared
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.cramer_rao_limit import TrueRun
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

SCENARIOS = ("paper_scenario_1", "paper_scenario_2")
BOUND = "bound"
ESTIMATORS = ("fixed", "rpem", "rpem_full", "ekf", "imm", BOUND)
SEEDS = 100
ASKED = {"n": 98.7, "C": 95.0, "concentrate_grade": 99.8}
ROWS_APART = 10
"""The error of a parameter changes slowly: its NEES is kept every so many rows."""


def run_part(scenario: Scenario, estimators: Sequence[str], seed: int) -> dict[str, pd.DataFrame]:
    """Fits, and NEES every tenth row over the time of the fits: a table of one row for each estimator."""
    figures: dict[str, dict[str, object]] = {}
    if BOUND in estimators:
        true = TrueRun(Realisation(scenario, seed), Realisation(scenario, seed).schedule)
        allowed = dict(zip(("n", "C"), true.fits(true.limit()), strict=True))
        figures[BOUND] = {**allowed, "concentrate_grade": np.nan, "nees": [np.nan]}
    names = [name for name in estimators if name != BOUND]
    for run in run_scenario(scenario, names, seeds=[seed]) if names else []:
        figures[run.estimator] = {**run.fit, "nees": list(nees(scenario, run))}
    return {name: pd.DataFrame([{"estimator": name, "seed": seed, **row}]) for name, row in figures.items()}


def nees(scenario: Scenario, run: Run) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Normalised estimation error squared of the adapted parameters n and C, every tenth row after `fits_after_s`."""
    table = run.table[run.table["time_s"] > scenario.fits_after + 1e-9].iloc[::ROWS_APART]
    if not (table[["n_std", "C_std"]].to_numpy() > 0).all():  # constant parameters claim to be exact
        return np.full(len(table), np.nan)
    error = table[["n_estimate", "C_estimate"]].to_numpy() - table[["n_true", "C_true"]].to_numpy()
    std = table[["n_std", "C_std"]].to_numpy()
    between = table["n_C_correlation"].to_numpy()
    correlation = np.stack([np.stack([np.ones_like(between), between]), np.stack([between, np.ones_like(between)])])
    return normalised_error_squared(error / std, correlation.transpose(2, 0, 1))


def parts(folder: Path, name: str, estimators: Sequence[str], seeds: Sequence[int]) -> pd.DataFrame:
    """Rows of a scenario; what has no part yet is run."""
    scenario = load_scenario(name)
    for seed in track(seeds, name, console=Console(stderr=True)):
        missing = [estimator for estimator in estimators if not part(folder, name, estimator, seed).is_file()]
        for estimator, rows in run_part(scenario, missing, seed).items():
            write_table(rows, part(folder, name, estimator, seed))
    files = [part(folder, name, estimator, seed) for estimator in estimators for seed in seeds]
    return pd.concat([read_table(file) for file in files], ignore_index=True)


def part(folder: Path, name: str, estimator: str, seed: int) -> Path:
    """File of one run."""
    return folder / f"{name}-{estimator}-seed{seed}.parquet"


def spread(values: pd.Series[float]) -> str:
    """Median, and the range between the 5 % and the 95 % quantile."""
    if not np.isfinite(values).any():
        return "–"
    low, middle, high = np.nanquantile(np.asarray(values, dtype=float), [0.05, 0.5, 0.95]).tolist()
    return f"{middle:.2f} [{low:.2f}, {high:.2f}]"


def over_bound(rows: pd.DataFrame, least: pd.DataFrame) -> str:
    """Root mean square error of n / C over that of the bound, over the seeds that both have.

    A fit is 100 less the root mean square error in percent of the truth's: whatever the size of the truth, the ratio of
    the two in one run is that of the errors.
    """
    pairs = rows.merge(least, on="seed", suffixes=("", "_bound"))
    if pairs.empty:
        return "–"
    wrong, best = (
        ((100.0 - pairs[[f"{key}{end}" for key in "nC"]].to_numpy()) ** 2).mean(axis=0) for end in ("", "_bound")
    )
    return " / ".join(f"{ratio:.2f}" for ratio in np.sqrt(wrong / best))


def consistency(rows: pd.DataFrame) -> list[str]:
    """Mean NEES over all runs and times; share of times with the mean over the runs in its band; share of samples."""
    values = np.stack([np.asarray(v, dtype=float) for v in rows["nees"]])
    if not np.isfinite(values).all():
        return ["–", "–", "–"]
    count, q = len(values), 2
    low, high = (float(chi2.ppf(share, q * count)) / count for share in (0.025, 0.975))
    by_time = values.mean(axis=0)
    inside = np.mean((by_time >= low) & (by_time <= high))
    covered = np.mean(values <= chi2.ppf(0.95, q))
    return [f"{values.mean():.2f}", f"{inside:.0%} in [{low:.2f}, {high:.2f}]", f"{covered:.1%}"]


def table_of(results: dict[str, pd.DataFrame]) -> Table:
    """What is printed."""
    heads = [f"{key.replace('_', ' ')} (asked {limit:g})" for key, limit in ASKED.items()]
    nees_heads = ("mean NEES (2)", "mean over runs in band", "samples below 95 %")
    table = Table("scenario", "estimator", "runs", *heads, "error / bound", *nees_heads)
    for name, rows in results.items():
        least = rows[rows["estimator"] == BOUND]
        for estimator, of in rows.groupby("estimator", sort=False):
            fits = [spread(of[key]) for key in ASKED]
            table.add_row(name, str(estimator), str(len(of)), *fits, over_bound(of, least), *consistency(of))
    return table


def main() -> None:
    """Run what is missing and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/accuracy"))
    parser.add_argument("--scenario", action="append", help="repeatable; default both paper scenarios")
    parser.add_argument("--estimator", action="append", help=f"repeatable; default {', '.join(ESTIMATORS)}")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds")
    parser.add_argument("--first-seed", type=int, default=1)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    names, estimators = options.scenario or SCENARIOS, options.estimator or ESTIMATORS
    results = {name: parts(options.out, name, estimators, seeds) for name in names}
    console = Console(width=None if Console().is_terminal else 190)
    console.print(f"Fits in percent, median [5 %, 95 %] over seeds {seeds[0]} to {seeds[-1]}")
    console.print(table_of(results))


if __name__ == "__main__":
    main()
