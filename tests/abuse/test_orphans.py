"""No process outlives the command that started it: real kills of real commands at work on two processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from adaptive_flot.errors import AdaptiveFlotError, DataError
from adaptive_flot.parallel import parallel_map
from tests.cli.discover.test_discover import write_tank

PATIENCE_S = 120.0


def _hear_hangup() -> None:
    """Tests under `nohup` would hand on a signal that is ignored, and an ignored one stays so on purpose."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def at_work(folder: Path) -> tuple[subprocess.Popen[str], list[psutil.Process]]:
    """A `discover` whose two workers are there, and these."""
    write_tank(folder)
    arguments = ["tank.csv", "--model", "heated:make_model", "--processes", "2", "--out", "out"]
    command = [sys.executable, "-m", "adaptive_flot", "discover", *arguments]
    process = subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=_hear_hangup,
    )
    end = time.monotonic() + PATIENCE_S
    workers: list[psutil.Process] = []
    while len(workers) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "no workers"
        time.sleep(0.02)
        workers = psutil.Process(process.pid).children(recursive=True)
    return process, workers


@pytest.fixture
def discovering(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], list[psutil.Process]]]:
    process, workers = at_work(tmp_path)
    yield process, workers
    for one in workers:
        if one.is_running():
            one.kill()
    process.kill()
    process.communicate()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL], ids=lambda n: n.name)
def test_workers_end_with_a_killed_discover(
    discovering: tuple[subprocess.Popen[str], list[psutil.Process]], tmp_path: Path, number: signal.Signals
) -> None:
    process, workers = discovering
    os.kill(process.pid, number)
    out, err = process.communicate(timeout=PATIENCE_S)
    _, alive = psutil.wait_procs(workers, timeout=PATIENCE_S)
    assert not alive, "workers outlive the process that started them"
    assert out == ""
    if number is signal.SIGKILL:
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert err == (
            f"adaptive-flot: ended by {number.name}; nothing is told. With --budget SECONDS a search ends by itself, "
            "and tells what it has come to\n"
        )
    assert {f.name for f in tmp_path.iterdir() if f.name != "__pycache__"} == {"tank.csv", "heated.py"}


def test_workers_end_when_one_call_fails() -> None:
    """The other call would sleep for an hour."""
    here = {p.pid for p in psutil.Process().children(recursive=True)}

    def fails(item: int) -> None:
        if item == 0:
            raise DataError("no")
        time.sleep(3600)

    with pytest.raises(DataError, match="no"):
        parallel_map(fails, [0, 1], 2)
    assert {p.pid for p in psutil.Process().children(recursive=True)} <= here


def test_calls_that_still_wait_end_in_silence_when_one_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread of the pool has many calls left when it loses its workers; a trace of it is no line for a user."""
    said: list[object] = []
    monkeypatch.setattr(threading, "excepthook", said.append)

    def fails(item: int) -> None:
        if item == 0:
            raise DataError("no")
        time.sleep(3600)

    with pytest.raises(DataError, match="no"):
        parallel_map(fails, list(range(40)), 2)
    assert said == []


def test_a_worker_killed_from_outside_is_one_line() -> None:
    with pytest.raises(AdaptiveFlotError, match="ended without a result"):
        parallel_map(lambda item: os.kill(os.getpid(), signal.SIGKILL), [0, 1], 2)
