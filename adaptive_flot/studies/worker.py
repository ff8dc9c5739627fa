"""What a worker process does: one run at a time, with everything that runs have in common built once."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.errors import PluginError, StudyError
from adaptive_flot.plugins import plugin_failure
from adaptive_flot.runner.commands.runs.run import initial_fit, run_one
from adaptive_flot.runner.commands.runs.run_files import plain, run_summary
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.runs_table import run_rows
from adaptive_flot.runner.commands.runs.side_by_side import run_side_by_side
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.studies.grid import content_hash

TIMES = ("seconds", "solve_median_s", "solve_p99_s")
"""Columns that depend on the machine and the hour: kept apart from what is compared."""
MOST_PREPARED = 8
"""Scenarios whose functions a worker keeps; a study runs through its scenarios together, seed by seed."""


@dataclass(frozen=True)
class Order:
    """A scenario with plug-ins, as it is sent to a worker.

    Attributes
    ----------
    path
        Scenario file, readable by the worker under the same path.
    content
        Hash of scenario and plug-ins when the study started.
    estimators, controllers
        Plug-ins by the name under which they run.
    shared
        Estimators whose runs of a seed share the initial fit.
    compiled
        Whether the step and the estimators run as machine code.
    together
        Controllers and estimators whose runs of many seeds go side by side.
    """

    path: Path
    content: str
    estimators: Mapping[str, Plugin]
    controllers: Mapping[str, Plugin]
    shared: frozenset[str]
    compiled: bool = False
    together: frozenset[tuple[str, str]] = frozenset()


@dataclass(frozen=True)
class Result:
    """What a run leaves behind: its row in the table of runs, and what it took."""

    row: dict[str, Any]
    timing: dict[str, Any]


class _Kept(threading.local):
    """What a thread has built: functions hold working memory, so no two threads may share them."""

    def __init__(self) -> None:
        self.prepared: dict[str, Prepared] = {}


_kept = _Kept()


_turn = threading.Lock()
"""Threads of a worker take turns: CasADi counts references to its symbols without a lock, and two threads that build
functions at once crash the process. A worker has one thread unless a user's own cluster gives it more."""


def fit_start(order: Order, controller: str, seed: int) -> BatchFit | str:
    """Initial fit that several runs of a seed share, or what went wrong."""
    with _turn:
        prepared = _prepare(order)
        try:
            return initial_fit(prepared, controller, Realisation(prepared.scenario, seed))
        except PluginError:
            raise
        except (Exception, SystemExit) as error:
            return _message(error)


def run(
    order: Order, names: Mapping[str, str], controller: str, estimator: str, seed: int, start: BatchFit | str | None
) -> Result:
    """Run one combination; what goes wrong in it becomes a row too, and does not stop the study.

    Parameters
    ----------
    order
        The scenario.
    names
        Columns that name the run: `run` and `scenario`.
    controller, estimator, seed
        The combination.
    start
        Initial fit, or why there is none; None: fit here.

    Raises
    ------
    StudyError, PluginError
        Something that would hit every run: the scenario is not the one that the study started with, a plug-in can not
        be loaded.
    """
    begin = time.perf_counter(), time.process_time()
    head = {**names, "controller": controller, "estimator": estimator, "seed": seed}
    try:
        if isinstance(start, str):
            return Result({**head, "outcome": "failed", "message": start}, _timing(head, begin))
        with _turn:
            begin = time.perf_counter(), time.process_time()
            prepared = _prepare(order)
            realisation = Realisation(prepared.scenario, seed)
            finished = run_one(prepared, estimator, controller, realisation, {} if start is None else {"fit": start})
            row = _outcome(prepared, finished)
    except (PluginError, StudyError):
        raise
    except (Exception, SystemExit) as error:
        return Result({**head, "outcome": "failed", "message": _message(error)}, _timing(head, begin))
    times = {key: row.pop(key) for key in TIMES if key in row}
    return Result({**row, **head}, {**times, **_timing(head, begin)})


def run_many(
    order: Order, names: Sequence[Mapping[str, str]], controller: str, estimators: Sequence[str], seeds: Sequence[int]
) -> list[Result]:
    """Run combinations of a controller and several estimators with many seeds, side by side; see `run`.

    Parameters
    ----------
    order
        The scenario.
    names
        Columns that name each run: seed by seed, all estimators of one behind one another.
    controller, estimators, seeds
        The combinations, each with every seed.

    Raises
    ------
    StudyError, PluginError
        As of `run`.
    """
    begin = time.perf_counter(), time.process_time()
    heads = [
        {**name, "controller": controller, "estimator": estimator, "seed": seed}
        for name, (seed, estimator) in zip(names, product(seeds, estimators), strict=True)
    ]
    try:
        with _turn:
            begin = time.perf_counter(), time.process_time()
            prepared = _prepare(order)
            realisations = [Realisation(prepared.scenario, seed) for seed in seeds]
            fits: list[dict[str, BatchFit]] = [{} for _ in seeds]  # all estimators of a seed share one
            found = [run_side_by_side(prepared, e, controller, realisations, fits) for e in estimators]
            rows = [_outcome(prepared, one[i]) for i in range(len(seeds)) for one in found]
    except (PluginError, StudyError):
        raise
    except (Exception, SystemExit) as error:
        rows = [{"outcome": "failed", "message": _message(error)}] * len(heads)
    results = []
    for head, row in zip(heads, rows, strict=True):
        times = {key: row[key] for key in TIMES if key in row}
        kept = {key: value for key, value in row.items() if key not in times}
        results.append(Result({**kept, **head}, {**times, **_timing(head, begin, len(heads))}))
    return results


def _outcome(prepared: Prepared, found: Run | Exception) -> dict[str, Any]:
    """Row of a run, or of what went wrong with it."""
    if isinstance(found, (PluginError, StudyError)):
        raise found
    if isinstance(found, Exception):
        return {"outcome": "failed", "message": _message(found)}
    row = run_rows(plain(run_summary(prepared.scenario, [found])))[0]
    del row["code"]  # a study that goes on after a commit gives the same table to the byte
    return {**row, "outcome": "ok", "message": ""}


def _prepare(order: Order) -> Prepared:
    known, key = _kept.prepared, f"{order.path} {order.content} {order.compiled}"
    if key not in known:
        scenario = load_scenario(order.path)
        if content_hash(scenario, order.estimators, order.controllers) != order.content:
            raise StudyError(
                f"{order.path}: the scenario, or code of an estimator or controller, is not here as it was when the "
                "study started; restore it and start the study again"
            )
        for plugin in (*order.estimators.values(), *order.controllers.values()):
            # a worker that lives longer than a study may have imported the user's file as it was before
            sys.modules.pop(Path(plugin.use.rpartition(":")[0]).stem if ".py:" in plugin.use else "", None)
        if len(known) == MOST_PREPARED:
            del known[next(iter(known))]
        scenario = scenario.compiled() if order.compiled else scenario
        known[key] = Prepared(scenario, order.estimators, order.controllers)
    return known[key]


def _timing(head: Mapping[str, Any], begin: tuple[float, float], runs: int = 1) -> dict[str, Any]:
    """Wall-clock and processor time since `begin`, for each of so many runs, and where."""
    spent = {"seconds": time.perf_counter() - begin[0], "cpu_seconds": time.process_time() - begin[1]}
    spent = {key: value / runs for key, value in spent.items()}
    where = f"{socket.gethostname()}:{os.getpid()}"
    return {"run": head["run"], "worker": where, **{key: round(value, 4) for key, value in spent.items()}}


def _message(error: BaseException) -> str:
    said = (
        f"{type(error).__name__}: {error}"
        if (failure := plugin_failure(error, full_path=False)) is None
        else str(failure)
    )
    return " ".join(said.split())
