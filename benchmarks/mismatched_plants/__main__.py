"""Run and print: `python -m benchmarks.mismatched_plants`, some minutes for 30 plants and one seed.

Writes one Parquet part for each plant and seed into the folder of `--out`; loops that are there are not run again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.data.tables import read_table, write_table
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.mismatched_plants.plants import CHANCE, COUNT, EARLY, FASTEST, LESS_CAREFUL, MODIFIERS, TREE, plant

MPC, ORACLE, PI = "economic_mpc", "oracle", "pi"
LOOPS = {
    "ekf": (MPC, "ekf"),
    "adaptive_imm": (MPC, "adaptive_imm"),
    "adaptive_imm, limit_probability 0.95": (CHANCE, "adaptive_imm"),
    "adaptive_imm, scenarios 9": (TREE, "adaptive_imm"),
    "adaptive_imm, scenarios 9, early plans": (EARLY, "adaptive_imm"),
    "adaptive_imm, scenarios 9, early plans, 0.8": (LESS_CAREFUL, "adaptive_imm"),
    "adaptive_imm, modifiers": (MODIFIERS, "adaptive_imm"),
    ORACLE: (MPC, ORACLE),
    PI: (PI, "fixed"),
    FASTEST: (FASTEST, "fixed"),
}
"""Controller and estimator of each."""
MOST_BELOW = 0.01
"""Share of the time that may be below the limit of the grade."""
LEAST_VALUE = 0.98
"""Share of the oracle's value that is asked."""


def figures(scenario: Scenario, seed: int, loops: Sequence[str]) -> pd.DataFrame:
    """A row for each loop: value, share of the time below the limit, and how often a model error was told."""
    runs = {
        name: run_scenario(scenario, [estimator], [seed], controllers=[controller])[0]
        for name, (controller, estimator) in LOOPS.items()
        if name in loops
    }
    return pd.DataFrame(
        [
            {
                "plant": scenario.name,
                "seed": seed,
                "loop": name,
                "value": run.account["value_cu_h"],
                "below": run.account["below_limit"],
                "told": run.status_counts.get("model_error", 0) / len(run.table),
            }
            for name, run in runs.items()
        ]
    )


def summary(rows: pd.DataFrame) -> Table:
    """What is printed: a row for each loop, over the plants and seeds that it was run for."""
    rows = rows.set_index(["plant", "seed", "loop"])[["value", "below"]].reindex(
        pd.MultiIndex.from_product([sorted(set(rows["plant"])), sorted(set(rows["seed"])), LOOPS])
    )
    rows = rows.rename_axis(["plant", "seed", "loop"]).reset_index()
    by = rows.pivot(index=["plant", "seed"], columns="loop", values=["value", "below"])
    table = Table(
        "loop", "below the limit: mean", "worst", f"<= {MOST_BELOW:.0%}", "at the bound",
        "value / oracle: median", "least", f">= {LEAST_VALUE:.0%}", "beats pi",
        title=f"{len(by)} closed loops with mismatched plants"
    )  # fmt: skip
    for loop in [name for name in LOOPS if by["below", name].notna().any()]:
        below, value = by["below", loop], by["value", loop]
        share, over_pi = (value / by["value", ORACLE]).dropna(), (value - by["value", PI]).dropna()
        bound = (below - by["below", FASTEST]).dropna()
        table.add_row(
            loop,
            f"{below.mean():.2%}",
            f"{below.max():.1%}",
            f"{int((below <= MOST_BELOW).sum())} of {below.notna().sum()}",
            f"{int((bound <= 0).sum())} of {len(bound)}",
            f"{share.median():.1%}",
            f"{share.min():.1%}",
            f"{int((share >= LEAST_VALUE).sum())} of {len(share)}",
            f"{int((over_pi > 0).sum())} of {len(over_pi)}",
        )
    return table


def main() -> None:
    """Run what is missing and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/mismatched_plants"))
    parser.add_argument("--plants", type=int, default=COUNT)
    parser.add_argument("--first-plant", type=int, default=0, help="number of the first plant")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, from 1 on")
    parser.add_argument("--compile", action="store_true", help="step and estimators as machine code: less time")
    parser.add_argument("--loop", action="append", choices=LOOPS, help="a loop to run, may be repeated; default: all")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    jobs = [
        (k, seed)
        for seed in range(1, options.seeds + 1)
        for k in range(options.first_plant, options.first_plant + options.plants)
    ]
    parts = {(k, seed): options.out / f"plant{k:02d}-seed{seed}.parquet" for k, seed in jobs}
    for (k, seed), part in track(parts.items(), "mismatched plants", console=Console(stderr=True)):
        done = read_table(part) if part.is_file() else pd.DataFrame({"loop": []})
        missing = [loop for loop in options.loop or LOOPS if loop not in set(done["loop"])]
        if missing:
            scenario = plant(k, options.out)
            new = figures(scenario.compiled() if options.compile else scenario, seed, missing)
            write_table(pd.concat([done, new], ignore_index=True) if len(done) else new, part)
    rows = pd.concat([read_table(part) for part in parts.values()], ignore_index=True)
    Console(width=None if Console().is_terminal else 150).print(summary(rows))


if __name__ == "__main__":
    main()
