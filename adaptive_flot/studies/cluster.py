"""Where runs are computed: an embedded cluster of processes on this machine, or a real one behind a scheduler."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster

from adaptive_flot.errors import StudyError
from adaptive_flot.greybox.stepping.rows import core_count
from adaptive_flot.studies.fork_server import interrupts_held_back, start_fork_server

SETTINGS = {
    "distributed.admin.large-graph-warning-threshold": "1GB",
    # the cluster watches itself: nobody reads it here, and it takes 5 % of each core
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.system-monitor.gil.enabled": False,
}
CONNECT_S = 15.0
"""Longest wait for a scheduler to answer and for its first worker to be there."""


@contextmanager
def connected(workers: int | None, scheduler: str | None) -> Iterator[Client]:
    """Client of a cluster.

    Parameters
    ----------
    workers
        Processes of the embedded cluster, each with one thread; default one a core.
    scheduler
        Address of a scheduler instead, `tcp://host:8786`.

    Raises
    ------
    StudyError
        No scheduler answers there, or it has no worker.
    """
    # what the cluster has to say of a killed worker is of no use to a reader: the run is simply done again
    for name in (*logging.root.manager.loggerDict, "distributed", "asyncio", "tornado"):
        if name.partition(".")[0] in ("distributed", "asyncio", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    method = start_fork_server() if scheduler is None else "spawn"
    with dask.config.set(SETTINGS | {"distributed.worker.multiprocessing-method": method}):
        if scheduler is None:
            with _embedded(workers or core_count()) as cluster, Client(cluster) as client:
                yield client
        else:
            with _remote(scheduler) as client:
                yield client


def _embedded(workers: int) -> LocalCluster:
    """Processes on this machine, one thread each.

    Ctrl-C goes to all of them. It is held back in this thread while the cluster starts, and in what that starts: this
    process alone decides how a sweep ends. A worker has the environment of this moment, not that of the process from
    which it is forked.
    """
    with interrupts_held_back():
        return LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
            env=dict(os.environ),
        )


@contextmanager
def _remote(address: str) -> Iterator[Client]:
    try:
        client = Client(address, timeout=CONNECT_S)
    except Exception as error:  # of many kinds: TLS without certificates is a TypeError
        reason = " ".join(str(error).split())
        raise StudyError(
            f"--scheduler {address}: no scheduler answers there ({reason}); start one with `dask scheduler`, or leave "
            "the option out"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError as error:
            raise StudyError(
                f"--scheduler {address}: the scheduler has no worker; start one: `dask worker {address} --nthreads 1`"
            ) from error
        yield client
