"""The process that workers of an embedded cluster are forked from: it imports once what each of them needs."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker

METHOD = "forkserver"
IMPORTED = ("distributed.nanny", "distributed.worker", "adaptive_flot.studies.worker")
"""Modules that the process imports before it forks."""
ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""What libraries read when they are loaded: a worker a core, so one thread each unless the user says otherwise."""


def start_fork_server() -> str:
    """Start the process where there is such a thing and it does not run yet; gives the method that workers start by.

    It imports while the caller does, so call it before the imports that take seconds. It ends with the caller. Ctrl-C
    is held back in it and in what is forked from it: the caller alone decides how a sweep ends.
    """
    if METHOD not in multiprocessing.get_all_start_methods():
        return "spawn"
    with interrupts_held_back(), _one_thread():
        multiprocessing.get_context(METHOD).set_forkserver_preload(list(IMPORTED))
        forkserver.ensure_running()
    return METHOD


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Hold back Ctrl-C in this thread, and for good in the threads and processes that it starts: they inherit this."""
    resource_tracker.ensure_running()  # to start it later would lift the mask
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


@contextmanager
def _one_thread() -> Iterator[None]:
    """The environment in which libraries are loaded for a worker."""
    added = {name: "1" for name in ONE_THREAD if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
