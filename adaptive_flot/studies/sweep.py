"""Run what is missing of a study: hand runs to a cluster, write each result as it comes in."""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import pandas as pd
from distributed import Client, Future, KilledWorker, as_completed

from adaptive_flot.errors import AdaptiveFlotError, StudyError, located
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.studies import worker
from adaptive_flot.studies.cluster import connected
from adaptive_flot.studies.folder import locked
from adaptive_flot.studies.grid import Combination, Grid, content_hash, grid_of
from adaptive_flot.studies.manifest import check_grid, remember
from adaptive_flot.studies.study_file import Arm, Study

LOST = (asyncio.CancelledError, concurrent.futures.CancelledError, OSError, TimeoutError)
"""What a lost scheduler looks like from here."""
AHEAD = 4
"""Runs handed to the cluster for each of its threads, so that none waits for the next one."""

Rows = Sequence[Mapping[str, Any]]
AnyFuture = Future[Any]
Progress = Callable[[Rows], None]


@dataclass(frozen=True)
class _Group:
    """Missing runs of one scenario, controller and seed: they share the initial fit."""

    order: worker.Order
    controller: str
    seed: int
    cases: tuple[Combination, ...]


@dataclass(frozen=True)
class Outcome:
    """A finished study: all its runs, and how many of them were there before."""

    table: pd.DataFrame
    timings: pd.DataFrame
    from_before: int


def sweep(
    study: Study,
    path: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    compiled: bool = False,
    progress: Callable[[int, Rows], Progress] = lambda total, before: lambda rows: None,
) -> Outcome:
    """Run what is missing of a study and complete its folder.

    Parameters
    ----------
    study
        The study.
    path
        Its folder.
    workers, scheduler
        Where to run, see `connected`.
    retry_failed
        Run failed runs again.
    compiled
        Run the step and the estimators as machine code; a worker without a compiler runs them plain.
    progress
        Called once with the number of runs and the rows that are there; what it returns is called with new rows.

    Raises
    ------
    StudyError
        The folder belongs to another study or to another sweep, or the cluster is lost.
    AdaptiveFlotError
        A plug-in can not be built.
    """
    grid = grid_of(study, compiled=compiled)
    if compiled:
        study = replace(study, arms=tuple(replace(a, scenario=a.scenario.compiled()) for a in study.arms))
    with locked(path) as folder:
        check_grid(path, grid)
        if retry_failed:
            folder.forget("failed")
        before = folder.table()
        groups = list(_missing(study, grid, set(before["run"])))
        advance = progress(len(grid.runs()), _rows(before))
        if groups:
            _check_plugins(groups, study)
            with _said_in_words(scheduler), connected(workers, scheduler) as client:
                remember(path, grid)  # not before there is somewhere to run
                for results in _results(client, groups):
                    rows = [r.row for r in results]
                    folder.add(rows, [r.timing for r in results])
                    advance(rows)
        else:
            remember(path, grid)
        folder.complete(grid.runs())
        return Outcome(folder.table(), folder.table("timings"), len(before))


def _rows(table: pd.DataFrame) -> Rows:
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]


def _missing(study: Study, grid: Grid, done: set[str]) -> Iterator[_Group]:
    orders = {arm.scenario.name: _order(arm) for arm in study.arms}
    for seed in grid.seeds:
        groups: dict[tuple[str, str], list[Combination]] = {}
        for case in grid.cases:
            if case.run(seed) not in done:
                groups.setdefault((case.scenario, case.controller), []).append(case)
        for (scenario, controller), cases in groups.items():
            yield _Group(orders[scenario], controller, seed, tuple(cases))


def _order(arm: Arm) -> worker.Order:
    content = content_hash(arm.scenario, arm.estimators, arm.controllers)
    prepared = Prepared(arm.scenario, arm.estimators, arm.controllers)
    shared = frozenset(name for name in arm.estimators if prepared.shares_fit(name))
    compiled = arm.scenario.model.compiled
    return worker.Order(arm.scenario.path, content, dict(arm.estimators), dict(arm.controllers), shared, compiled)


def _check_plugins(groups: Sequence[_Group], study: Study) -> None:
    """Build each plug-in that will run once here: a wrong option is said now, and not by every run."""
    used = {(g.order.path, g.controller, c.estimator) for g in groups for c in g.cases}
    for arm in study.arms:
        prepared = Prepared(arm.scenario, arm.estimators, arm.controllers)
        first = Realisation(arm.scenario, study.seeds[0])
        mine = [(controller, estimator) for path, controller, estimator in used if path == arm.scenario.path]
        with located(study.path):
            for controller in sorted({c for c, _ in mine}):
                prepared.controller(controller, first, arm.scenario.setup)
            for estimator in sorted({e for _, e in mine}):
                prepared.estimator(estimator, first)


def _results(client: Client, groups: Sequence[_Group]) -> Iterator[list[worker.Result]]:
    """Results as they come in; at any time only a few runs for each thread are with the cluster."""
    token, waiting = uuid4().hex[:8], deque(groups)
    heads: dict[str, dict[str, Any]] = {}
    finished = as_completed([], with_results=True, raise_errors=False)

    def top_up() -> None:
        threads = max(1, sum(client.ncores().values()))
        while waiting and finished.count() < AHEAD * threads:
            for future, head in _submit(client, waiting.popleft(), token):
                heads[str(future.key)] = head
                finished.add(future)

    top_up()
    for batch in finished.batches():
        results = [_result(what, heads.pop(str(future.key))) for future, what in batch]
        good = [r for r in results if isinstance(r, worker.Result)]
        if good:
            yield good
        for error in (e for e in results if isinstance(e, BaseException)):  # after the good ones of the batch are safe
            raise error
        top_up()


def _submit(client: Client, group: _Group, token: str) -> Iterator[tuple[AnyFuture, dict[str, Any]]]:
    order, controller, seed = group.order, group.controller, group.seed
    start = None
    sharing = [case for case in group.cases if case.estimator in order.shared]
    if len(sharing) > 1:
        key = f"start-{sharing[0].run(seed)}-{token}"
        start = client.submit(worker.fit_start, order, controller, seed, key=key, pure=False)
    for case in group.cases:
        names = {"run": case.run(seed), "scenario": case.scenario}
        key = f"run-{names['run']}-{token}"
        fit = start if case in sharing else None
        future = client.submit(worker.run, order, names, controller, case.estimator, seed, fit, key=key, pure=False)
        yield future, {**names, "controller": controller, "estimator": case.estimator, "seed": seed}


def _result(returned: Any, head: dict[str, Any]) -> worker.Result | BaseException:
    """Result of a run, or the error that ends the study."""
    if isinstance(returned, worker.Result):
        return returned
    error: BaseException = returned[1] if isinstance(returned, tuple) else returned
    if isinstance(error, KilledWorker):
        message = f"the worker process died {error.allowed_failures + 1} times with this run (too little memory?)"
        return worker.Result({**head, "outcome": "failed", "message": message}, {"run": head["run"]})
    if isinstance(error, (AdaptiveFlotError, *LOST)):
        return error
    return StudyError(
        f"run {head['run']}: a worker can not work ({type(error).__name__}: {error}); "
        "install the same version of adaptive-flot and its plug-ins for all workers"
    )


@contextmanager
def _said_in_words(scheduler: str | None) -> Iterator[None]:
    """Turn a failure of the cluster into one line."""
    try:
        yield
    except LOST as error:
        where = f"the scheduler at {scheduler}" if scheduler else "the embedded cluster"
        raise StudyError(
            f"lost {where} ({type(error).__name__}); the results so far are kept, the same command goes on from them"
        ) from error
