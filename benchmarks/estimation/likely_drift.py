"""What the first 600 s tell of a drift that comes later: `python -m benchmarks.estimation.likely_drift`.

Most likely drift of the joint filter (`estimators/ekf/likely_drift.py`) and the largest that is not rejected at 95 %:
from the record before the estimators start and, in hindsight, from the whole run. In the scenarios of the paper
nothing drifts in the first 600 s. Maximum likelihood there asks for a filter that follows nothing afterwards.
"""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.contracts import Prior, full_parameters
from adaptive_flot.greybox.steady.steady_state import steady_state, steady_state_gradient
from adaptive_flot.runner.plants.scenario_plant import simulate_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from estimators.ekf.likely_drift import DriftFit, most_likely_drift

SCENARIOS = ("paper_scenario_1", "random_walk")
SEEDS = (1001,)
OFF = np.array([1.02, 0.97])
"""Start as a share of the nominal n and C: near the truth, not at it."""
START_STD = 0.1


def start(scenario: Scenario, seed: int) -> Prior:
    """Steady at parameters near the nominal ones, which are known to 10 %."""
    setup, inputs = scenario.setup, Realisation(scenario, seed).schedule[0]
    theta = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)] * OFF
    p = full_parameters(setup.model, setup.parameters, theta)
    x = steady_state(setup.model, inputs, p).state
    moved = np.vstack([steady_state_gradient(setup.model, x, inputs, p, setup.parameters), np.eye(theta.size)])
    spread = np.diag((START_STD * theta) ** 2)
    noise = np.array([scenario.file.measurements[name].noise_std for name in setup.outputs])
    return Prior(0.0, x, theta, spread, noise, moved @ spread @ moved.T)


def fits(scenario: Scenario, seed: int) -> tuple[DriftFit, DriftFit]:
    """Drift from the first part of a run and from all of it."""
    samples = [record.sample for record in simulate_plant(Realisation(scenario, seed))]
    prior = start(scenario, seed)
    first = most_likely_drift(scenario.setup, prior, samples[: scenario.initial_rows])
    return first, most_likely_drift(scenario.setup, prior, samples)


def main() -> None:
    """Measure and print."""
    table = Table("scenario", "seed", "first 600 s", "whole run", title="Drift, share an hour: most likely, upper 95 %")
    for name in SCENARIOS:
        scenario = load_scenario(name)
        for seed in SEEDS:
            cells = (f"{fit.drift_per_hour:.3f}, {fit.upper:.3f}" for fit in fits(scenario, seed))
            table.add_row(name, str(seed), *cells)
    Console(width=None if Console().is_terminal else 100).print(table)


if __name__ == "__main__":
    main()
