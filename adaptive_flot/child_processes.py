"""Signals end this program, whatever it is at, and the processes that it started end with it, however it ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

PARENT_CHECK_S = 1.0
"""How often a process looks whether the one that started it is still there [s]."""
ENDING = tuple(signal.Signals[name] for name in ("SIGTERM", "SIGHUP") if name in signal.Signals.__members__)
"""Signals that ask a program to end."""


class Terminated(BaseException):
    """A signal asks this program to end. It is no `Exception`, so that nobody takes it for a failed fit.

    Attributes
    ----------
    number
        The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = signal.Signals(number)

    @property
    def exit_code(self) -> int:
        """What a shell gives for a process that this signal ended."""
        return 128 + self.number


_asked: list[int] = []
"""The signal that asked this program to end, once one has. Compiled libraries call handlers too, and lose what they
raise or turn it into an error of theirs. So what was asked for is kept here also."""


def asked_to_end() -> signal.Signals | None:
    """The signal that asked this program to end in the block of `terminable`; None before one has."""
    return signal.Signals(_asked[0]) if _asked else None


def heed_signals() -> None:
    """End the work if a signal asked for it and a library lost that. It costs next to nothing, so loops call it.

    Raises
    ------
    KeyboardInterrupt, Terminated
        As the handlers of `terminable` do. In the main thread only, as they do.
    """
    if _asked and threading.current_thread() is threading.main_thread():
        _raise(_asked[0])


def _raise(number: int) -> NoReturn:
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise Terminated(number)


@contextmanager
def terminable() -> Iterator[None]:
    """Raise in the block when a signal asks for the end, so that what it started is ended first.

    Ctrl-C raises `KeyboardInterrupt` as ever, other signals raise `Terminated`. A second signal ends the program at
    once. Signals that are ignored (`nohup`) stay ignored. Outside the main thread, where Python takes no signals, the
    block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = {**dict.fromkeys(ENDING, signal.SIG_DFL), signal.SIGINT: signal.default_int_handler}
    taken = {number: handler for number, handler in usual.items() if signal.getsignal(number) is handler}

    def end(number: int, frame: object) -> None:
        del frame
        for one in taken:
            signal.signal(one, signal.SIG_DFL)
        _asked.append(number)
        _raise(number)

    for number in taken:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in taken.items():
            signal.signal(number, handler)
        _asked.clear()


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let signals that ask for the end, and Ctrl-C, wait until a block has run: it writes files that belong together.

    A signal mask would not do: another thread of this process would take the signal. Outside the main thread, where
    Python takes no signals, the block runs as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    former = {number: signal.getsignal(number) for number in (*ENDING, signal.SIGINT)}
    taken = {number: handler for number, handler in former.items() if handler not in (signal.SIG_IGN, None)}
    for number in taken:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in taken.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])


@contextmanager
def forking() -> Iterator[None]:
    """Hold back signals while this process forks: a child would take them as its parent does, until it is set up."""
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {*ENDING, signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


def end_with_parent(parent: int) -> None:
    """End this process, forked in `forking` or spawned, when its parent is gone, also one that was killed.

    Signals that ask for the end work at once here. Ctrl-C, which a terminal sends to all processes, is left to the
    parent.

    Parameters
    ----------
    parent
        Process identifier of the parent. It is given, because the parent may be gone when this is called.
    """

    def look(number: int, frame: object) -> None:
        del number, frame
        if os.getppid() != parent:
            os._exit(1)

    for number in ENDING:
        signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {*ENDING, signal.SIGINT})
    signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, PARENT_CHECK_S, PARENT_CHECK_S)
