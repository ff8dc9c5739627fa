"""A search in a process of its own: its result, its errors and its end reach the run."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time

import pytest

from adaptive_flot.errors import AdaptiveFlotError, ModelError
from adaptive_flot.runner.adaptation.background import Background


def test_the_result_comes_from_another_process_and_may_close_over_anything() -> None:
    here = os.getpid()
    there, value = Background(lambda: (os.getpid(), here + 1)).result()
    assert value == here + 1 and there != here


def test_an_error_of_the_search_is_raised_where_its_result_is_asked_for() -> None:
    def fails() -> None:
        raise ModelError("no sites")

    with pytest.raises(ModelError, match="no sites"):
        Background(fails).result()


def test_a_process_that_dies_is_an_error_and_not_a_wait_for_ever() -> None:
    with pytest.raises(AdaptiveFlotError, match="without a result"):
        Background(lambda: os._exit(1)).result()
    with pytest.raises(AdaptiveFlotError, match="can not be sent"):
        Background(lambda: lambda: None).result()


def test_a_search_that_nobody_waits_for_is_ended() -> None:
    """One that would sleep for an hour is gone once `stop` returns."""
    search = Background(lambda: time.sleep(3600))
    search.stop()
    assert search._process is not None and not search._process.is_alive()


def test_a_daemon_may_have_no_children_and_calls_by_itself() -> None:
    """A worker of a study is one: its searches run where they are."""
    receiver, sender = multiprocessing.Pipe(duplex=False)

    def work() -> None:
        sender.send((os.getpid(), Background(os.getpid).result()))

    worker = multiprocessing.get_context("fork").Process(target=work, daemon=True)
    worker.start()
    mine, its = receiver.recv()
    worker.join()
    assert mine == its != os.getpid()


def test_a_search_ends_with_a_run_that_was_killed() -> None:
    """Its end of a pipe closes, which else only happens when the hour is over."""
    receiver, sender = multiprocessing.Pipe(duplex=False)

    def run() -> None:
        Background(lambda: time.sleep(3600))
        os.kill(os.getpid(), signal.SIGKILL)

    killed = multiprocessing.get_context("fork").Process(target=run)
    killed.start()
    killed.join()
    sender.close()
    with pytest.raises(EOFError):  # every process that held the other end is gone
        receiver.recv()
