"""How well n and C can be told apart depends on the inputs: `python -m benchmarks.estimation.excitation`.

The plant of paper scenario 1 (ramps of C, then n; the grade alone measured) under other input sequences: the fits that
two posterior Cramer-Rao bounds allow, with the grade alone and with more sensors, and those that the estimators reach.
`told` knows when the parameters turn (`drift_of_time_profile` of the bound). `walk` believes, as `ekf` does, that both
walk all the time, by 6 % an hour. Medians over a few seeds. The sequences of the paper are not published, so that a
published fit of C belongs to a row of this table that nobody knows.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.filtering.cramer_rao_bound import random_walk
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.results.cramer_rao_limit import MORE_SENSORS, TrueRun
from adaptive_flot.runner.scenario.inputs.profiles import InputProfile
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

ESTIMATORS = ("ekf", "imm")
SEEDS = 5
WALK = 0.06
"""Share of a parameter an hour: the default of `ekf`."""
AIR, FEED, LEVEL = "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m"
LOW, HIGH = 9.05e-4, 2.17e-3
_PROFILE: TypeAdapter[InputProfile] = TypeAdapter(InputProfile)


def sequences() -> dict[str, dict[str, dict[str, Any]]]:
    """Name to the inputs that differ from paper scenario 1."""
    level = {"profile": "random", "between": [0.33, 0.42], "seed": "per_run"}
    air = {"profile": "random", "between": [LOW, HIGH], "every_s": 60, "seed": 1}
    still_air = {"profile": "constant", "value": 1.5e-3}
    return {
        "as shipped: air up in 40 steps, level every 160 s": {},
        "air down (paper scenario 2)": {AIR: {"profile": "staircase", "from": HIGH, "to": LOW, "every_s": 60}},
        "level every 40 s": {LEVEL: {**level, "every_s": 40}},
        "level every 640 s": {LEVEL: {**level, "every_s": 640}},
        "level at rest": {LEVEL: {"profile": "constant", "value": 0.38}},
        "air at rest": {AIR: still_air},
        "air and level at rest": {AIR: still_air, LEVEL: {"profile": "constant", "value": 0.38}},
        "air at random every 60 s": {AIR: air},
        "air at random every 60 s, level every 40 s": {AIR: air, LEVEL: {**level, "every_s": 40}},
        "... and feed +-20 % every 100 s": {
            AIR: air,
            LEVEL: {**level, "every_s": 40},
            FEED: {"profile": "random", "between": [1.34e-4, 2.0e-4], "every_s": 100, "seed": 2},
        },
    }


def with_inputs(scenario: Scenario, inputs: dict[str, dict[str, Any]]) -> Scenario:
    """The scenario under other inputs."""
    profiles = {column: _PROFILE.validate_python(content) for column, content in inputs.items()}
    changed = {"inputs": {**scenario.file.inputs, **profiles}}
    return replace(scenario, file=scenario.file.model_copy(update=changed))


def medians(scenario: Scenario, estimators: Sequence[str], seeds: Sequence[int]) -> list[str]:
    """Median fits of n / C: the four bounds, each estimator; last the correlation at the first bound."""
    bounds: list[list[FloatArray]] = []
    ties = []
    for seed in seeds:
        run = TrueRun(Realisation(scenario, seed), Realisation(scenario, seed).schedule)
        P = run.limit()
        late = P[scenario.initial_rows :]
        walking = random_walk(len(P), WALK * run.adapted[0] * np.sqrt(scenario.dt / 3600.0))
        walking.variance[: scenario.initial_rows] = 0.0  # the estimators know that nothing moves until they start
        courses = (None, walking)
        bounds.append([run.fits(run.limit(c, sensors)) for c in courses for sensors in ({}, MORE_SENSORS)])
        ties.append(np.median(late[:, 0, 1] / np.sqrt(late[:, 0, 0] * late[:, 1, 1])))
    runs = run_scenario(scenario, estimators, seeds) if estimators else []
    reached = [np.array([[r.fit["n"], r.fit["C"]] for r in runs if r.estimator == name]) for name in estimators]
    cells = [np.median(np.array(values), axis=0).tolist() for values in (*zip(*bounds, strict=True), *reached)]
    return [*(f"{n:.2f} / {c:.2f}" for n, c in cells), f"{np.median(np.array(ties)):.3f}"]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds, from 1 on")
    parser.add_argument("--bound-only", action="store_true", help="run no estimator")
    options = parser.parse_args()
    estimators: tuple[str, ...] = () if options.bound_only else ESTIMATORS
    scenario = load_scenario("paper_scenario_1")
    heads = ("told", "told, more sensors", "walk", "walk, more sensors", *estimators, "correlation")
    table = Table("inputs", *heads, title=f"Fits of n / C in percent, medians of seeds 1 to {options.seeds}")
    for name, inputs in track(sequences().items(), "excitation", console=Console(stderr=True)):
        table.add_row(name, *medians(with_inputs(scenario, inputs), estimators, range(1, options.seeds + 1)))
    Console(width=None if Console().is_terminal else 150).print(table)


if __name__ == "__main__":
    main()
