"""A plant that hangs, a link that is killed: nothing is doubled or half stored, and the link finds its way back."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from subprocess import PIPE

import pytest
import yaml
from sqlalchemy import ColumnElement, Table, create_engine, func, select
from sqlalchemy.exc import OperationalError

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.running.run import SILENT_INTERVALS
from adaptive_flot.live.store import schema
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.processes.test_server import free_port

MAIN = [sys.executable, "-m", "adaptive_flot"]


def program(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*MAIN, *arguments], capture_output=True, text=True, timeout=120)


def wait_for(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    """Wait; the limit only ends a test that would wait for ever."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


def test_a_hung_plant_and_a_killed_link(
    scenario: Scenario, certificates: Path, write_link: Callable[..., Link], tmp_path: Path
) -> None:
    port = free_port()
    link = write_link(scenario, {"controller": "pi", "cycle.deadline": 0.95}, port=port, speed=10)
    database = link.path.parent / "live.sqlite"
    arguments = ["serve-plant", str(scenario.path), "--certificates", str(certificates)]
    plant = subprocess.Popen([*MAIN, *arguments, "--port", str(port), "--speed", "10"], stdout=subprocess.DEVNULL)
    engine = create_engine(f"sqlite:///{database}")

    def count(table: Table, *where: ColumnElement[bool]) -> int:
        if not database.exists():
            return 0
        try:
            with engine.connect() as connection:
                return connection.execute(select(func.count()).select_from(table).where(*where)).scalar() or 0
        except OperationalError:  # the tables are being made
            return 0

    def estimates() -> int:
        return count(schema.estimates)

    def silent() -> int:
        return count(schema.cycles, schema.cycles.c.alive.is_(False), schema.cycles.c.cycle > 10)

    try:
        first = subprocess.Popen([*MAIN, "live", str(link.path)], stdout=subprocess.DEVNULL)
        try:
            wait_for(lambda: estimates() > 10)
            plant.send_signal(signal.SIGSTOP)  # connected, and silent
            known = silent()
            wait_for(lambda: silent() > known + SILENT_INTERVALS + 2)
            plant.send_signal(signal.SIGCONT)
            known = estimates()
            wait_for(lambda: estimates() > known + 5)
        finally:
            os.kill(first.pid, signal.SIGKILL)
            first.wait()
        stored = estimates()
        again = subprocess.Popen([*MAIN, "live", str(link.path)], stdout=PIPE, stderr=PIPE, text=True)
        try:
            wait_for(lambda: estimates() > stored)
        finally:
            again.terminate()
            said, wrong = again.communicate()
    finally:
        plant.terminate()
        plant.wait()
    assert (again.returncode, wrong) == (0, "")
    assert "Session 2: rpem and pi" in said
    assert "in monitor, from the estimate of session 1, cycle" in said
    assert "control is with the plant" in said
    c, e, s = schema.cycles.c, schema.estimates.c, schema.samples.c
    with engine.connect() as connection:
        for session in (1, 2):
            query = select(c.cycle).where(c.session == session).order_by(c.cycle)
            numbers = list(connection.execute(query).scalars())
            assert numbers == list(range(1, len(numbers) + 1)), "no cycle lost, none doubled"
        both = schema.estimates.outerjoin(schema.samples, (e.session == s.session) & (e.cycle == s.cycle))
        alone = select(func.count()).select_from(both).where(s.cycle.is_(None))
        assert connection.execute(alone).scalar() == 0, "no cycle is half stored"
    engine.dispose()
    done = program("export", str(link.path), "--replay")
    assert done.returncode == 0 and "all the same to the bit" in done.stdout


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tags.air_flow.unit": "kg"}, "tags.air_flow: unit 'kg' can not be converted to 'm3/s'"),
        ({"tags.air_flux": {"tag": "x"}}, "the model has no 'air_flux'; did you mean 'air_flow'?"),
        ({"tags.concentrate_grade": ...}, "'concentrate_grade' has no tag"),
        ({"writes.air_flow.high": 1.0}, "are wider than the scenario's limits"),
        ({"writes.air_flow": ...}, "writes: give one for each of air_flow, level_setpoint"),
        ({"controller": "mpc"}, "has no controller 'mpc'; known: hold, pi"),
        ({"server.security": "None"}, "server.security"),
        ({"highest_mode": "auto"}, "highest_mode"),
        ({"cycle.shed_aftr": 3}, "unknown key 'cycle.shed_aftr'; did you mean 'shed_after'?"),
        ({"database": "nonsense"}, "database"),
        ({"server.password_file": "none"}, "can not be read"),
    ],
)
def test_a_wrong_link_file_is_one_line_and_nothing_is_written(
    scenario: Scenario,
    certificates: Path,
    write_link: Callable[..., Link],
    tmp_path: Path,
    changes: Mapping[str, object],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from adaptive_flot.cli.entry import main
    from tests.edits import edit

    good = write_link(scenario, port=free_port())
    content = edit(yaml.safe_load(good.path.read_text()), changes)
    bad = tmp_path / "bad.yaml"
    bad.write_text(yaml.safe_dump(content))
    monkeypatch.setattr(sys, "argv", ["adaptive-flot", "live", str(bad), "--cycles", "20"])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 2, said
    assert len(said.splitlines()) == 1 and words in said
    if "password_file" not in str(changes):
        assert list(tmp_path.iterdir()) == [bad]
