"""Throughput of a study: scenario 1 x RPEM with one and two workers, plain and compiled, and simulated ones beyond.

`python -m benchmarks.timing.throughput [--runs 40]`. Wall-clock time is that of the machine at this hour; processor
time is what a quiet one needs. With more workers than cores the runs are simulated: each sleeps for the time a
compiled run takes and hands back a real row, so that scheduler, transport and writing of results are the real ones.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from distributed import Client, LocalCluster
from rich.console import Console
from rich.table import Table

from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.rows import core_count
from adaptive_flot.studies import sweep as module
from adaptive_flot.studies import worker
from adaptive_flot.studies.study_file import Study, load_study

SIMULATED = (2, 8, 32)
"""Workers that are simulated; two of them to compare with two real ones."""
RUNS_EACH = 15
"""Simulated runs for each simulated worker."""


@dataclass(frozen=True)
class Measured:
    """A sweep: what ran, runs, wall-clock time, processor time of a run in its worker and of the main process."""

    what: str
    workers: int
    runs: int
    wall_s: float
    run_cpu_s: float
    main_cpu_s: float

    def cells(self) -> Sequence[str]:
        """Cells of the table."""
        return (
            self.what,
            str(self.workers),
            str(self.runs),
            f"{self.runs / self.wall_s:.2f}",
            f"{self.run_cpu_s:.3f}" if self.run_cpu_s else "–",
            f"{1e3 * self.main_cpu_s:.1f}",
            f"{1000 * self.wall_s / self.runs / 60:.1f}",
        )


def measure(study: Study, workers: int, *, compiled: bool) -> Measured:
    """Run a study in a folder of its own; what comes before each worker's first runs is left out."""
    folder = Path(tempfile.mkdtemp(prefix="throughput-"))
    marks: list[tuple[float, float]] = []

    def progress(total: int, before: module.Rows) -> module.Progress:
        del total, before
        return lambda rows: marks.extend([(time.perf_counter(), time.process_time())] * len(rows))

    try:
        outcome = module.sweep(study, folder, workers=workers, compiled=compiled, progress=progress)
    finally:
        shutil.rmtree(folder)
    # what comes before the first result of each worker is start-up: imports, and functions that all its runs share
    (wall, cpu), (wall_end, cpu_end), counted = marks[2 * workers - 1], marks[-1], len(marks) - 2 * workers
    late = outcome.timings.iloc[2 * workers :]
    what = "compiled" if compiled else "plain"
    return Measured(
        what, workers, counted, wall_end - wall, float(late["cpu_seconds"].median()), (cpu_end - cpu) / counted
    )


def simulated(study: Study, workers: int, seconds: float) -> Measured:
    """Many workers on few cores: every run sleeps."""
    threads = max(1, workers // 2)
    runs = RUNS_EACH * workers
    asked = replace(study, seeds=tuple(range(1, runs + 1)))

    @contextmanager
    def connected(*_: Any) -> Iterator[Client]:
        with (
            LocalCluster(
                n_workers=workers // threads,
                threads_per_worker=threads,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                silence_logs=50,
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client

    with patch.object(module, "connected", connected), patch.object(worker, "run", _Sleeping(seconds)):
        return replace(measure(asked, workers, compiled=False), what="simulated", run_cpu_s=0.0)


class _Sleeping:
    """Stands for `worker.run`."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def __call__(
        self, order: worker.Order, names: dict[str, str], controller: str, estimator: str, seed: int, start: object
    ) -> worker.Result:
        del order, start
        time.sleep(self.seconds)
        head = {**names, "controller": controller, "estimator": estimator, "seed": seed, "outcome": "ok", "message": ""}
        row = {**head, **{f"fit_{k}": 1.0 / (seed + k) for k in range(3)}, "status_ok": 1800}
        return worker.Result(row, {"run": names["run"], "seconds": self.seconds, "cpu_seconds": 0.0})


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40, help="real runs of each sweep")
    count = parser.parse_args().runs
    study = replace(load_study("paper_1000"), seeds=tuple(range(1, count + 1)))
    problem = compiler_problem()
    measurements = [
        measure(study, workers, compiled=c) for c in ([False] if problem else [False, True]) for workers in (1, 2)
    ]
    seconds = min(m.run_cpu_s for m in measurements)
    measurements += [simulated(study, workers, seconds) for workers in SIMULATED]
    columns = ("runs", "workers", "number", "runs/s", "worker CPU/run [s]", "main CPU/run [ms]", "1000 runs [min]")
    table = Table(*columns, title=f"Scenario 1 x rpem on {core_count()} cores")
    for m in measurements:
        table.add_row(*m.cells())
    console = Console(width=None if Console().is_terminal else 130)
    console.print(table)
    for m in measurements[: -len(SIMULATED)]:
        if m.workers == 2:
            quiet = 1000 * (m.run_cpu_s + m.main_cpu_s) / 2 / 60
            console.print(f"1000 runs, {m.what}, by processor time over two cores: {quiet:.1f} min (asked <= 5)")
    if problem:
        console.print(f"Nothing compiled: {problem}")


if __name__ == "__main__":
    main()
