"""What test plant and link have in common as programs: an orderly end, and libraries that keep quiet."""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def quiet_libraries() -> None:
    """The logs of asyncua and uvicorn repeat what this program says in its own words, or what strangers send."""
    for name in ("asyncua", "uvicorn"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def settle() -> None:
    """Leave what the start has made out of later garbage collections: one over all of it would stop a cycle."""
    gc.collect()
    gc.freeze()


@asynccontextmanager
async def until_stopped() -> AsyncIterator[asyncio.Event]:
    """Yield an event that Ctrl-C and the signals that ask for the end set, so that control is given back first."""
    stop, loop = asyncio.Event(), asyncio.get_running_loop()
    taken = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    former = {number: signal.getsignal(number) for number in taken}
    for number in taken:
        loop.add_signal_handler(number, stop.set)
    try:
        yield stop
    finally:
        for number in taken:
            loop.remove_signal_handler(number)
            signal.signal(number, former[number])
