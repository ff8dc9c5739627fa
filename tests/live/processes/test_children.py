"""Processes beside a link end with it, also where it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.children import NICE
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.shadow.worker import ShadowPlan, ShadowStepper
from tests.live.page_bench import wait_for

PARENT = """
import multiprocessing, os, sys, time
from pathlib import Path
from adaptive_flot.live.link.discovery import LiveDiscovery
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.shadow.process import Shadow
from adaptive_flot.live.shadow.worker import ShadowPlan
from tests.live.processes.test_children import builds, searches

link = load_link(Path(sys.argv[1]))
discovery = LiveDiscovery(link, searches)
pool = discovery._executor()
pool.submit(searches, Path(sys.argv[2]), None, ())
shadow = Shadow(Path(sys.argv[2]), ShadowPlan("twin", "rpem"), ("level",), builds)
time.sleep(3600)
"""


def _begun(folder: Path, name: str) -> None:
    (folder / f"{name}.part").write_text(f"{os.getpid()} {os.nice(0)}")
    (folder / f"{name}.part").rename(folder / name)
    time.sleep(3600)


def searches(folder: Path, record: Dataset, effects: tuple[Effect, ...]) -> Finding:
    """A search that lasts."""
    _begun(folder, "search")
    raise AssertionError


def builds(folder: Path, plan: ShadowPlan) -> ShadowStepper:
    """A shadow that is being built, and listens to nobody."""
    _begun(folder, "shadow")
    raise AssertionError


def runs(number: int) -> bool:
    """Whether a process has not ended; one that nobody has waited for yet (zombie) has."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_killed_link_leaves_no_process_behind(link: Link, tmp_path: Path) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(link.path), str(tmp_path)])
    files = [tmp_path / "search", tmp_path / "shadow"]
    try:
        wait_for(lambda: all(file.exists() for file in files), 120)
    finally:
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
    children, niceness = zip(*(map(int, file.read_text().split()) for file in files), strict=True)
    assert set(niceness) == {min(19, os.nice(0) + NICE)}, "the cycle goes first"
    try:
        wait_for(lambda: not any(runs(number) for number in children), 60)
    finally:
        for number in filter(runs, children):
            os.kill(number, signal.SIGKILL)
