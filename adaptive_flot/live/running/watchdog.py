"""Ends a program whose cycle does not end.

A solver or a plug-in that never returns can not be stopped in its thread. Shipped solvers have limits of their own,
which are a status: `fatrop` in iterations, `ipopt` in time. What is left ends the process. That is what a kill -9 does:
the plant has control, nothing stored is lost, and the next start is in monitor from the last stored estimate.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import sys
from collections.abc import Iterator
from typing import NoReturn

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link_file import Link

FIRST_FIT = 15.0
"""The first estimate is a fit to a record: it may take so many times as long."""
ORDERLY_S = 10.0
"""Time for an orderly end; where even that does not come, the operating system ends the process."""
CODE = 1


class HungCycleError(LinkError):
    """A cycle has not ended in its time."""


def longest_cycle_s(link: Link, estimating: bool) -> float:
    """How long a cycle may take [s]: `cycle.ends_after_s`, and never less than it has before it counts as hung."""
    cycle = link.file.cycle
    interval = link.scenario.dt / cycle.speed
    return max(cycle.ends_after_s * (1.0 if estimating else FIRST_FIT), 2 * cycle.shed_after * interval)


def watch(seconds: float) -> None:
    """End the process in so many seconds unless called again; it needs no turn of Python: a solver may not give one."""
    faulthandler.dump_traceback_later(seconds, exit=True, file=2)


@contextlib.contextmanager
def unwatched_after() -> Iterator[None]:
    """Watch no longer after the block."""
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def end_now(error: HungCycleError) -> NoReturn:
    """End the process without waiting for the thread that hangs."""
    sys.stderr.write(f"adaptive-flot: {error}\n")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(CODE)
