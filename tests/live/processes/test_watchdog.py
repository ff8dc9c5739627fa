"""A cycle that never ends gives control back and ends the process, also where Python gets no turn any more."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from asyncua import ua
from sqlalchemy import select

from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.running.watchdog import FIRST_FIT, HungCycleError, longest_cycle_s
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.memory import open_database
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.processes.test_server import SPEED, client, free_port, together, write

HANGING = """
import sys, time
from pathlib import Path
from adaptive_flot.live import program
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.running import run, watchdog

def hang(self, state, snapshot):
    {hang}

real = Cycle.step
Cycle.step = lambda self, state, snapshot: (real if state.number < 3 else hang)(self, state, snapshot)
watchdog.FIRST_FIT, run.ORDERLY_S = 1.0, 3.0
program.live(load_link(Path(sys.argv[1])))
"""


@pytest.mark.parametrize(
    ("hang", "words"),
    [
        ("time.sleep(3600)", "cycle 4 does not end: what it calls (solver, plug-in, database) hangs"),
        ("sum(range(10**13))", "in hang"),  # machine code that lets no other thread run, as a solver may
    ],
)
def test_a_process_whose_cycle_hangs_ends_by_itself(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path, hang: str, words: str
) -> None:
    link = write_link(scenario, {"controller": "pi", "cycle.ends_after_s": 1.0}, port=free_port(), speed=SPEED)
    program = HANGING.format(hang=hang)
    command = [sys.executable, "-c", program, str(link.path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 1 and words in ended.stderr
    engine = open_database(link.file.database, link.path.parent)
    with engine.connect() as connection:
        assert list(connection.execute(select(schema.cycles.c.cycle)).scalars()) == [1, 2, 3]
    engine.dispose()


def test_control_is_with_the_plant_before_the_link_ends(
    write_link: Callable[..., Link], scenario: Scenario, certificates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient = {"controller": "pi", "cycle.deadline": 0.95, "cycle.shed_after": 10, "cycle.ends_after_s": 3.0}
    link = write_link(scenario, patient, port=free_port(), speed=SPEED)
    hangs, freed = threading.Event(), threading.Event()
    real = Cycle.step

    def step(cycle: Cycle, state: Any, snapshot: Any) -> Any:
        if hangs.is_set():
            freed.wait()
        return real(cycle, state, snapshot)

    monkeypatch.setattr(Cycle, "step", step)

    async def run() -> None:
        try:
            async with together(link, certificates) as both:
                await both.until(lambda: both.link.state.estimation.estimate is not None)
                async with client(both.server, "operator") as operator:
                    await write(operator, "plant.switch", 3, ua.VariantType.Int64)
                    await both.until(lambda: both.mode is Mode.CLOSED and both.server.state.panel.active)
                hangs.set()
                await both.until(lambda: not both.server.state.panel.active)
                await both.until(lambda: both.link._client is None)
        finally:
            freed.set()

    with pytest.raises(HungCycleError, match="control is with the plant"):
        asyncio.run(run())


def test_ctrl_c_lets_a_slow_cycle_come_to_its_end(
    write_link: Callable[..., Link], scenario: Scenario, certificates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = write_link(scenario, {"controller": "pi"}, port=free_port(), speed=SPEED)
    slow, freed = threading.Event(), threading.Event()
    real = Cycle.step

    def step(cycle: Cycle, state: Any, snapshot: Any) -> Any:
        slow.set()
        freed.wait()
        return real(cycle, state, snapshot)

    monkeypatch.setattr(Cycle, "step", step)

    async def run() -> int:
        async with together(link, certificates) as both:
            await both.until(slow.is_set)
            asyncio.get_running_loop().call_later(1.0, freed.set)
        return both.link.state.number

    assert asyncio.run(run()) == 1


def test_the_first_fit_and_slow_plants_have_more_time(write_link: Callable[..., Link], scenario: Scenario) -> None:
    link = write_link(scenario, {"cycle.ends_after_s": 60.0}, speed=1)
    assert longest_cycle_s(link, True) == 60 and longest_cycle_s(link, False) == 60 * FIRST_FIT
    slow = write_link(scenario, {"cycle.ends_after_s": 1.0}, speed=0.1)
    assert longest_cycle_s(slow, True) == 2 * 3 * 10 * scenario.dt, "never before it has counted as hung"
