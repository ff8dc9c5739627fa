"""What probing costs and what it is good for: `python -m benchmarks.control.probing`, about a minute a seed.

Runs `closed_loop_drift_down`, where the economic MPC at its constraints starves its estimator:

- with the true parameters (oracle) and probing whether it is needed or not, the difference in value is the **price**;
- with RPEM the difference is what is left after the **use**: n and C known better, and what that is worth.

Runs are paired by seed; the medians and ranges over the seeds are printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table

from adaptive_flot.runner.commands.comparison import SeedSpread
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.keys import CaseEntry
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario

SCENARIO = "closed_loop_drift_down"
SEEDS = 5
PLAIN, PROBING, ALWAYS = "economic_mpc", "probing", "probing_always"
OPTIONS: dict[str, dict[str, float]] = {PROBING: {}, ALWAYS: {"needed_std": 0.0}}
CASES = ((PLAIN, "rpem"), (PROBING, "rpem"), (PLAIN, "oracle"), (ALWAYS, "oracle"))
LABELS = ("n", "C")


@dataclass(frozen=True)
class Measured:
    """One run.

    Attributes
    ----------
    value
        Economic value [cu/h].
    below
        Share of the time below the grade limit.
    errors
        Median distance of n and of C from the truth, relative to it.
    grade_error
        Root mean square of predicted minus true grade.
    probing
        Share of the time with a dip.
    """

    value: float
    below: float
    errors: tuple[float, float]
    grade_error: float
    probing: float

    @classmethod
    def of(cls, run: Run, after_s: float) -> Measured:
        """Figures of a run after a time [s]."""
        late = run.table[run.table["time_s"] > after_s]
        n, c = (float(np.median(np.abs(late[f"{x}_estimate"] / late[f"{x}_true"] - 1))) for x in LABELS)
        missed = late["concentrate_grade_predicted"] - late["concentrate_grade_true"]
        return cls(
            value=run.account["value_cu_h"],
            below=run.account["below_limit"],
            errors=(n, c),
            grade_error=float(np.sqrt(np.mean(missed**2))),
            probing=float(np.mean(late["decided_by"] == "probing")),
        )


def with_probing(scenario: Scenario) -> Scenario:
    """The scenario with its economic MPC beside copies of it that probe."""
    own = scenario.file.controllers[PLAIN]
    probing = {
        name: own.model_copy(update={"options": own.options | {"probing": options}})
        for name, options in OPTIONS.items()
    }
    cases = [CaseEntry(controller=controller, estimator=estimator) for controller, estimator in CASES]
    file = scenario.file.model_copy(update={"controllers": {PLAIN: own} | probing, "cases": cases})
    return replace(scenario, file=file)


def rows(medians: pd.DataFrame) -> Iterator[tuple[str, str, str]]:
    """Lines of the table: what, and its spread without and with probing."""
    for label, column, scale, digits in (
        ("value, RPEM [cu/h]", "value", 1, 4),
        ("median error of n [%]", "n", 100, 2),
        ("median error of C [%]", "C", 100, 2),
        ("predicted grade, RMS error [1e-3]", "grade", 1000, 3),
        ("below the grade limit [% of time]", "below", 100, 2),
        ("time on dips [%]", "probing", 100, 1),
    ):
        without, probing = (_shown(scale * medians[name, "rpem", column], digits) for name in (PLAIN, PROBING))
        yield label, without, probing


def _shown(values: pd.Series[float], digits: int) -> str:
    s = SeedSpread.of(np.asarray(values, dtype=float))
    return f"{s.median:.{digits}f} [{s.low:.{digits}f}, {s.high:.{digits}f}]"


def measure(scenario: Scenario, seeds: range) -> pd.DataFrame:
    """Figures of all runs: a row a seed, columns (controller, estimator, figure)."""
    by_seed: dict[int, dict[tuple[str, str, str], float]] = {}
    for seed in seeds:
        by_seed[seed] = {}
        for run in run_scenario(scenario, seeds=[seed]):
            m = Measured.of(run, scenario.fits_after)
            entries = {"value": m.value, "n": m.errors[0], "C": m.errors[1], "grade": m.grade_error}
            entries |= {"below": m.below, "probing": m.probing}
            by_seed[seed] |= {(run.controller, run.estimator, key): x for key, x in entries.items()}
        Console(stderr=True).print(f"seed {seed} done")
    return pd.DataFrame.from_dict(by_seed, orient="index")


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds, from 1 on")
    parser.add_argument("--scenario", default=SCENARIO)
    parser.add_argument("--out", type=Path, help="also write every run's figures to this CSV file")
    options = parser.parse_args()
    values = measure(with_probing(load_scenario(options.scenario)), range(1, options.seeds + 1))
    if options.out is not None:
        values.to_csv(options.out)
    table = Table("median [range]", "without", "probing", title=f"{options.scenario}, {len(values)} seeds")
    for row in rows(values):
        table.add_row(*row)
    console = Console(width=None if Console().is_terminal else 130)
    console.print(table)
    price = values[PLAIN, "oracle", "value"] - values[ALWAYS, "oracle", "value"]
    gained = values[PROBING, "rpem", "value"] - values[PLAIN, "rpem", "value"]
    console.print(f"price (true parameters, probing all the same): {_shown(1000 * price, 2)} mcu/h")
    console.print(f"value gained with RPEM, price paid: {_shown(1000 * gained, 2)} mcu/h")


if __name__ == "__main__":
    main()
