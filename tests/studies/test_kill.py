"""Real kills of real processes in the middle of a sweep: nothing is lost but runs in flight, nothing is there twice."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import psutil
import pytest
from pandas.testing import assert_frame_equal

from adaptive_flot.studies.study_file import load_study
from adaptive_flot.studies.sweep import sweep
from tests.studies.conftest import WriteStudy

PROGRAM = str(Path(sys.executable).with_name("adaptive-flot"))
SEEDS = 16
PATIENCE_S = 120.0
SECONDS = "SECONDS_OF_A_RUN"
"""Name of the variable that says how long a run takes at least, where a kill is to fall into the middle of a study."""
SLOW = f"""
import os, time
from estimators.fixed import Fixed

class Slow(Fixed):
    def init(self, prior):
        time.sleep(float(os.environ.get("{SECONDS}", "0")))
        return super().init(prior)
"""


def _heed_interrupts() -> None:
    """As in a terminal: tests that a shell runs in the background, as CI may, inherit that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Sweep:
    """A sweep as a process of its own."""

    def __init__(self, folder: Path, *options: str, seconds: float = 0.2) -> None:
        self.out = folder / "out"
        command = [PROGRAM, "sweep", "study.yaml", "--out", "out", *options]
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, SECONDS: str(seconds)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=_heed_interrupts,
        )

    def done(self) -> list[str]:
        """Runs on disk; a part that is being renamed is seen the next time."""
        return [run for part in (self.out / "parts").glob("0*-runs.parquet") for run in pd.read_parquet(part)["run"]]

    def wait_for(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end, "nothing happens"
            time.sleep(0.02)

    def workers(self) -> list[psutil.Process]:
        """What the process forked that the program keeps for it: both have its command line."""
        children = psutil.Process(self.process.pid).children(recursive=True)
        servers = {c.pid for c in children if "forkserver" in " ".join(c.cmdline())}
        return [c for c in children if c.ppid() in servers]

    def end(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, out, err


@pytest.fixture
def slow(write_study: WriteStudy, tmp_path: Path) -> Path:
    """Folder of a study of 16 runs."""
    (tmp_path / "slow.py").write_text(SLOW)
    write_study({"estimators": {"slow": {"use": "slow:Slow"}}, "seeds": {"count": SEEDS}})
    return tmp_path


@pytest.fixture
def undisturbed(slow: Path, at_hand: None) -> pd.DataFrame:
    """The same study in one go, in this process."""
    return sweep(load_study(slow / "study.yaml"), slow / "undisturbed").table


def test_killed_worker_ctrl_c_and_killed_main_process(slow: Path, undisturbed: pd.DataFrame) -> None:
    """Each in the middle of one study; then it is finished, with another number of workers."""
    first = Sweep(slow, "--workers", "2")
    first.wait_for(lambda: len(first.done()) >= 2)
    victim = first.workers()[0]
    victim.kill()
    before = len(first.done())
    first.wait_for(lambda: len(first.done()) >= before + 2)  # it goes on
    os.killpg(first.process.pid, signal.SIGINT)  # as Ctrl-C does: to the workers too
    code, _, err = first.end()
    assert code == 130 and "the same command goes on" in err and "Traceback" not in err
    kept = first.done()
    assert 4 <= len(kept) < SEEDS

    second = Sweep(slow, "--workers", "1")
    second.wait_for(lambda: len(second.done()) >= len(kept) + 2)
    orphans = second.workers()
    second.process.kill()
    second.end()
    more = second.done()
    assert len(set(more)) == len(more) < SEEDS and set(kept) < set(more)

    third = Sweep(slow, "--workers", "1", seconds=0.0)
    code, out, err = third.end()
    assert code == 0, err
    assert f"{SEEDS} runs, {len(more)} of them from before" in " ".join(out.split())
    assert (third.out / "runs.parquet").read_bytes() == (slow / "undisturbed" / "runs.parquet").read_bytes()
    assert_frame_equal(pd.read_parquet(third.out / "runs.parquet"), undisturbed)
    timings = pd.read_parquet(third.out / "timings.parquet")
    assert timings["run"].tolist() == undisturbed["run"].tolist()
    _, alive = psutil.wait_procs(orphans, timeout=PATIENCE_S)
    assert not alive, "workers outlive the process that started them"


def test_killed_scheduler(slow: Path, undisturbed: pd.DataFrame) -> None:
    """One clear line, and what was finished is there; the study then goes on without a real cluster."""
    with _real_cluster(slow) as (address, scheduler):
        lost = Sweep(slow, "--scheduler", address)
        lost.wait_for(lambda: len(lost.done()) >= 3)
        scheduler.kill()
        code, _, err = lost.end()
    assert code == 2 and f"lost the scheduler at {address}" in err and "Traceback" not in err
    kept = lost.done()
    assert 3 <= len(kept) < SEEDS
    found = sweep(load_study(slow / "study.yaml"), slow / "out")
    assert found.from_before == len(kept)
    assert_frame_equal(found.table, undisturbed)


@contextmanager
def _real_cluster(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler and a worker, as a user of a real cluster starts them."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    address, quiet = f"tcp://127.0.0.1:{port}", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask, here = str(Path(sys.executable).with_name("dask")), ["--host", "127.0.0.1", "--no-dashboard"]
    commands = [
        [dask, "scheduler", "--port", str(port), *here],
        [dask, "worker", address, "--nthreads", "1", "--no-nanny", *here],
    ]
    env = {**os.environ, SECONDS: "0.2"}  # of the worker, in which runs are made
    processes = [subprocess.Popen(command, cwd=folder, env=env, **quiet) for command in commands]  # type: ignore[call-overload]
    try:
        yield address, processes[0]
    finally:
        for process in processes:
            process.kill()
            process.wait()
