"""Run what is missing of a study: hand runs to a cluster, write each result as it comes in."""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any
from uuid import uuid4

import pandas as pd
from distributed import Client, Future, KilledWorker, as_completed

from adaptive_flot.errors import AdaptiveFlotError, StudyError, located
from adaptive_flot.runner.commands.runs.side_by_side import can_go_side_by_side
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
MOST_TOGETHER = 64
"""Most seeds that go side by side, and what an interruption loses: a second or two of work."""

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
            groups = _check_plugins(groups, study)
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


def _check_plugins(groups: Sequence[_Group], study: Study) -> list[_Group]:
    """Build each plug-in that will run once here: a wrong option is said now, and not by every run.

    Returns the groups, whose orders now say which combinations may go side by side.
    """
    together: dict[Path, frozenset[tuple[str, str]]] = {}
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
            together[arm.scenario.path] = frozenset(c for c in mine if can_go_side_by_side(prepared, c[1], c[0], first))
    return [replace(g, order=replace(g.order, together=together[g.order.path])) for g in groups]


def _bundles(groups: Sequence[_Group], threads: int) -> Iterator[Sequence[_Group]]:
    """Groups that are handed over at once: one alone, or several seeds that go side by side."""
    beside: dict[tuple[Path, str, tuple[str, ...]], list[_Group]] = {}
    for group in groups:
        pairs = [(case, (group.controller, case.estimator) in group.order.together) for case in group.cases]
        alone, together = (tuple(case for case, side in pairs if side is wanted) for wanted in (False, True))
        if alone:
            yield [replace(group, cases=alone)]
        if together:
            key = group.order.path, group.controller, tuple(case.estimator for case in together)
            beside.setdefault(key, []).append(replace(group, cases=together))
    for same in beside.values():
        size = max(1, min(MOST_TOGETHER, -(-len(same) // threads)))
        yield from (same[i : i + size] for i in range(0, len(same), size))


def _results(client: Client, groups: Sequence[_Group]) -> Iterator[list[worker.Result]]:
    """Results as they come in; at any time only a few runs for each thread are with the cluster."""
    threads = max(1, sum(client.ncores().values()))
    token, waiting = uuid4().hex[:8], deque(_bundles(groups, threads))
    heads: dict[str, list[dict[str, Any]]] = {}
    finished = as_completed([], with_results=True, raise_errors=False)

    def top_up() -> None:
        threads = max(1, sum(client.ncores().values()))
        while waiting and finished.count() < AHEAD * threads:
            bundle = waiting.popleft()
            beside = (bundle[0].controller, bundle[0].cases[0].estimator) in bundle[0].order.together
            for future, head in _submit_many(client, bundle, token) if beside else _submit(client, bundle[0], token):
                heads[str(future.key)] = head
                finished.add(future)

    top_up()
    for batch in finished.batches():
        results = [result for future, what in batch for result in _result(what, heads.pop(str(future.key)))]
        good = [r for r in results if isinstance(r, worker.Result)]
        if good:
            yield good
        for error in (e for e in results if isinstance(e, BaseException)):  # after the good ones of the batch are safe
            raise error
        top_up()


def _submit_many(
    client: Client, bundle: Sequence[_Group], token: str
) -> Iterator[tuple[AnyFuture, list[dict[str, Any]]]]:
    order, controller, estimators = bundle[0].order, bundle[0].controller, [c.estimator for c in bundle[0].cases]
    names = [{"run": case.run(g.seed), "scenario": case.scenario} for g in bundle for case in g.cases]
    seeds = [g.seed for g in bundle]
    key = f"runs-{names[0]['run']}-{token}"
    future = client.submit(worker.run_many, order, names, controller, estimators, seeds, key=key, pure=False)
    what = product(seeds, estimators)
    yield (
        future,
        [
            {**name, "controller": controller, "estimator": estimator, "seed": seed}
            for name, (seed, estimator) in zip(names, what, strict=True)
        ],
    )


def _submit(client: Client, group: _Group, token: str) -> Iterator[tuple[AnyFuture, list[dict[str, Any]]]]:
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
        yield future, [{**names, "controller": controller, "estimator": case.estimator, "seed": seed}]


def _result(returned: Any, heads: list[dict[str, Any]]) -> list[worker.Result | BaseException]:
    """Results of runs that were handed over at once, or the error that ends the study."""
    if isinstance(returned, worker.Result):
        return [returned]
    if isinstance(returned, list):
        return list(returned)
    error: BaseException = returned[1] if isinstance(returned, tuple) else returned
    if isinstance(error, KilledWorker):
        message = f"the worker process died {error.allowed_failures + 1} times with this run (too little memory?)"
        return [worker.Result({**h, "outcome": "failed", "message": message}, {"run": h["run"]}) for h in heads]
    if isinstance(error, (AdaptiveFlotError, *LOST)):
        return [error]
    return [
        StudyError(
            f"run {heads[0]['run']}: a worker can not work ({type(error).__name__}: {error}); "
            "install the same version of adaptive-flot and its plug-ins for all workers"
        )
    ]


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
