"""A function for many independent rows in one call, on the cores of this machine."""

from __future__ import annotations

import math
import multiprocessing
import os

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.stepping.compiling.compiled import compiled

CHUNK = 64
"""Most rows a `mapaccum` call takes at once: what it costs to make grows with its rows, what it saves does not."""


def core_count() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def worker_threads() -> int:
    """Number of threads for this process: one a core, or one where it is one of several processes.

    A worker of a study or a fit of a search is such a process: the others have the cores.
    """
    return 1 if multiprocessing.parent_process() is not None else core_count()


def over_rows(function: ca.Function, rows: int, *, as_machine_code: bool = False) -> ca.Function:
    """`function` with `rows` columns side by side in each argument and result; a single column serves all rows.

    The rows go to as many threads as `worker_threads` allows. The results are the same to the bit, whatever their
    number.
    """
    one = compiled(function) if as_machine_code else function
    threads = worker_threads()
    return one.map(rows, "thread", min(threads, rows)) if min(threads, rows) > 1 else one.map(rows)


def chunks(n: int) -> list[tuple[NDArray[np.intp], int]]:
    """Rows of each call, equally many in all so that one function serves them, and how many of these count.

    The last call repeats its last row.
    """
    size = math.ceil(n / max(1, math.ceil(n / CHUNK)))
    return [(np.minimum(np.arange(i, i + size), n - 1), min(size, n - i)) for i in range(0, n, max(size, 1))]
