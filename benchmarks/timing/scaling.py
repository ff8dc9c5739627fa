"""Does the cost of an online estimator grow with the record? `python -m benchmarks.timing.scaling` (some minutes).

Replays scenario 1 round and round for 1e3 to 1e6 updates and keeps nothing but the state. Time is that of the
processor; memory is the largest the process ever held, beyond what it held after the first thousand updates.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import sys
import time
from dataclasses import replace
from itertools import cycle, islice
from typing import Any

from rich.console import Console
from rich.table import Table

from adaptive_flot.contracts import Prior, Sample
from adaptive_flot.plugins import ESTIMATORS, load
from adaptive_flot.runner.scenario.loading import load_scenario
from benchmarks.estimation.forgetting import record

ONLINE = ("rpem", "rpem_full")
LENGTHS = (1_000, 10_000, 100_000, 1_000_000)


def held_mb() -> float:
    """Largest resident memory of this process so far [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def replay(estimator: Any, prior: Prior, samples: list[Sample], updates: int) -> tuple[float, int]:
    """Processor time of so many updates [s], and size of the last state [bytes]."""
    state, now, dt = estimator.init(prior), prior.time, estimator.setup.dt
    begin = time.process_time()
    for sample in islice(cycle(samples), updates):
        now += dt
        state, _ = estimator.update(state, replace(sample, time=now))
    return time.process_time() - begin, len(pickle.dumps(state))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--estimator", action="append", choices=list(ESTIMATORS), help="repeatable; default RPEM's two")
    parser.add_argument("--longest", type=float, default=LENGTHS[-1], help="number of updates to stop at")
    options = parser.parse_args()
    prior, shown = record("paper_scenario_1", 1)
    samples, setup = [r.sample for r in shown], load_scenario("paper_scenario_1").setup
    table = Table("estimator", "updates", "seconds", "us an update", "state, bytes", "memory added, MB")
    for name in options.estimator or ONLINE:
        estimator = load(name, ESTIMATORS, "estimator")(setup)
        replay(estimator, prior, samples, LENGTHS[0])
        before = held_mb()
        for updates in (n for n in LENGTHS if n <= options.longest):
            seconds, size = replay(estimator, prior, samples, updates)
            each, added = f"{1e6 * seconds / updates:.1f}", f"{held_mb() - before:.1f}"
            table.add_row(name, f"{updates:.0e}", f"{seconds:.3f}", each, str(size), added)
    Console(width=None if Console().is_terminal else 110).print(table)


if __name__ == "__main__":
    main()
