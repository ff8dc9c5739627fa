"""What an update costs, as a multiple of that of the EKF: `python -m benchmarks.kinds_of_change.cost`."""

from __future__ import annotations

import time

from rich.console import Console

from adaptive_flot.plugins import ESTIMATORS, load
from adaptive_flot.runner.commands.runs.run import initial_fit
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.plants.scenario_plant import simulate_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation

NAMES, REPEATS = ("ekf", "imm", "adaptive_imm"), 5


def main() -> None:
    """Replay one record through each estimator in turn, and print the least time of an update of each."""
    scenario = load_scenario("paper_scenario_1")
    realisation, first = Realisation(scenario, 1), scenario.initial_rows
    prior = initial_fit(Prepared.of(scenario), "schedule", realisation).prior(first * scenario.dt)
    samples = [record.sample for record in simulate_plant(realisation)[first:]]
    made = {name: load(name, ESTIMATORS, "estimator")(scenario.setup) for name in NAMES}
    least = dict.fromkeys(NAMES, float("inf"))
    for _ in range(REPEATS):
        for name, estimator in made.items():
            begin, state = time.process_time(), estimator.init(prior)
            for sample in samples:
                state, _ = estimator.update(state, sample)
            least[name] = min(least[name], (time.process_time() - begin) / len(samples))
    for name, seconds in least.items():
        Console().print(f"{name}: {1e6 * seconds:.0f} us an update, {seconds / least['ekf']:.2f} times ekf")


if __name__ == "__main__":
    main()
