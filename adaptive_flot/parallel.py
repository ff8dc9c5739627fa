"""Independent work on several processes, where the system can fork; else one after the other, with the same results."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from adaptive_flot.child_processes import end_with_parent, forking
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.stepping.rows import core_count

Item = TypeVar("Item")
Result = TypeVar("Result")
_work: Callable[[Any], Any] | None = None


def _call(item: Any) -> Any:
    assert _work is not None  # set before the fork
    return _work(item)


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra on one thread, in this process and those that it forks.

    Cores are for processes: threads beside them only wait for each other. And sums are then taken in the same order on
    every machine, so that the last digits of a verdict do not depend on its number of cores.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        yield


def parallel_map(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    processes: int,
    done: Callable[[], None] = lambda: None,
) -> list[Result]:
    """`[function(item) for item in items]`; `done` is called after each.

    The function may close over anything (a model's equations do not pickle): workers are forked with it. Items and
    results must pickle. Workers end with this process, and at once when one of the calls fails.

    Raises
    ------
    AdaptiveFlotError
        A worker was ended from outside.
    Exception
        What the function raised.
    """
    if processes < 2 or len(items) < 2 or "fork" not in multiprocessing.get_all_start_methods():
        results = []
        for item in items:
            results.append(function(item))
            done()
        return results
    try:
        return _forked_map(function, items, min(processes, len(items)), done)
    except BrokenProcessPool as error:
        raise AdaptiveFlotError(
            "a process ended without a result (not enough memory?); give fewer processes"
        ) from error


def _forked_map(
    function: Callable[[Item], Result], items: Sequence[Item], processes: int, done: Callable[[], None]
) -> list[Result]:
    global _work
    _work = function
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("fork")
    try:
        with ProcessPoolExecutor(processes, context, initializer=end_with_parent, initargs=(os.getpid(),)) as pool:
            try:
                with forking():
                    # Not `pool.map`, which cancels what is left: a pool that loses its workers then fails on these.
                    coming = [pool.submit(_call, item) for item in items]
                results = []
                for one in coming:
                    results.append(one.result())
                    done()
                return results
            except BaseException:
                for worker in set(multiprocessing.active_children()) - others:  # else the pool waits for their calls
                    worker.terminate()
                raise
    finally:
        _work = None


def available_processes() -> int:
    """Cores this process may use."""
    return core_count()
