"""Test plant and link as processes of their own over OPC UA, killed, stopped and started again."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from sqlalchemy import Engine, create_engine, text

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.runner.scenario.loading import load_scenario

PROGRAM = [sys.executable, "-m", "adaptive_flot"]
SPEED = 5.0
WRITTEN = "select count(*) from write_results where problem = ''"
LONGEST_S = 240.0
HELD = 35
"""Cycles in closed before the next fault: one decision of the controller at least, so that it writes."""
FIRST_S = 900.0
"""Longest time until the link has control at first: the record of the first fit, on a busy machine."""


@dataclass
class Network:
    """The two processes and the database between them.

    Parameters
    ----------
    folder
        For link file and database; `certificates` lie in it.
    scenario
        Shipped scenario.
    """

    folder: Path
    scenario: str
    back_s: list[float] = field(default_factory=list)
    control_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        url = f"opc.tcp://127.0.0.1:{self.port}/adaptive-flot"
        made = link_text(load_scenario(self.scenario), url, self.folder / "certificates", speed=SPEED)
        content: dict[str, Any] = yaml.safe_load(made)
        content["database"] = "sqlite:///network.sqlite"
        self.link_file = self.folder / "network.yaml"
        self.link_file.write_text(yaml.safe_dump(content))
        self.engine: Engine = create_engine(f"sqlite:///{self.folder / 'network.sqlite'}")
        self.plant, self.link = self.start_plant(), self.start_link()

    def start_plant(self) -> subprocess.Popen[bytes]:
        """A test plant whose operator lets the link go to closed."""
        options = ["--certificates", str(self.folder / "certificates"), "--port", str(self.port), "--speed", str(SPEED)]
        command = [*PROGRAM, "serve-plant", self.scenario, *options, "--hours", "24", "--auto-operator"]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL)

    def start_link(self) -> subprocess.Popen[bytes]:
        """A link."""
        return subprocess.Popen([*PROGRAM, "live", str(self.link_file)], stdout=subprocess.DEVNULL)

    def scalar(self, query: str) -> int:
        """A number from the database; 0 before it has tables."""
        try:
            with self.engine.connect() as connection:
                return int(connection.execute(text(query)).scalar() or 0)
        except Exception:  # the link is making the tables
            return 0

    def alive(self) -> int:
        """Cycles with a new sample."""
        return self.scalar("select count(*) from cycles where alive")

    def wait_for_samples(self, more: int = 5) -> float:
        """Wait for new samples; how long it took [s]. AdaptiveFlotError after a minute and a half."""
        begin, known = time.monotonic(), self.alive()
        while self.alive() < known + more:
            if time.monotonic() - begin > LONGEST_S:
                raise AdaptiveFlotError(f"no new samples for {LONGEST_S:g} s")
            time.sleep(0.05)
        return time.monotonic() - begin

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """Kill -9."""
        os.kill(process.pid, signal.SIGKILL)
        process.wait()

    def round(self) -> None:
        """Kill the link, let the server hang, kill it: each time in closed, until the link has control again."""
        self.kill(self.link)
        self.link = self.start_link()
        self.control_s.append(self.wait_for_closed())
        self.plant.send_signal(signal.SIGSTOP)
        time.sleep(8)
        self.plant.send_signal(signal.SIGCONT)
        self.back_s.append(self.wait_for_samples(1))
        self.control_s.append(self.wait_for_closed())
        self.kill(self.plant)
        time.sleep(3)
        self.plant = self.start_plant()
        self.wait_until_listening()
        self.back_s.append(self.wait_for_samples(1))
        self.control_s.append(self.wait_for_closed())

    def wait_for_closed(self, longest: float = LONGEST_S) -> float:
        """Wait until the link has had control for HELD cycles; how long it took to get it [s]."""
        begin, known, granted = time.monotonic(), self.closed(), 0.0
        while (closed := self.closed()) < known + HELD:
            waited = time.monotonic() - begin
            granted = granted or (waited if closed > known else 0.0)
            if waited > longest:
                raise AdaptiveFlotError(f"the link has had no control for {HELD} cycles after {longest:g} s")
            time.sleep(0.1)
        return granted or time.monotonic() - begin

    def closed(self) -> int:
        """Cycles in closed."""
        return self.scalar("select count(*) from cycles where mode = 'closed'")

    def unsafe(self) -> int:
        """Set-points that should never be sent: not in closed, without a sample, outside clamps, too far at once.

        A change counts from one cycle of a session to the next one.
        """
        query = (
            "select w.session, w.cycle, w.input, w.value, c.mode, c.alive from writes w "
            "join cycles c on c.session = w.session and c.cycle = w.cycle order by w.session, w.cycle"
        )
        parts, found = load_link(self.link_file).file.writes, 0
        before: dict[tuple[int, int, str], float] = {}
        with self.engine.connect() as connection:
            for session, cycle, name, value, mode, alive in connection.execute(text(query)):
                part = parts[name]
                room = 1e-9 * max(abs(part.low), abs(part.high))
                last = before.get((session, cycle - 1, name), value)
                found += (
                    mode != "closed"
                    or not alive
                    or not part.low - room <= value <= part.high + room
                    or abs(value - last) > part.rate + room
                )
                before[session, cycle, name] = value
        return found

    def wait_until_listening(self) -> None:
        """Until the server takes connections again: from then on the time of the link counts."""
        for _ in range(int(LONGEST_S / 0.05)):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)

    def close(self) -> None:
        """End both."""
        for process in (self.link, self.plant):
            process.terminate()
            process.wait()


def network_figures(folder: Path, scenario: str, rounds: int) -> dict[str, object]:
    """Figures of rounds of kills, by name."""
    network = Network(folder, scenario)
    try:
        network.wait_for_samples()
        network.wait_for_closed(FIRST_S)
        for _ in range(rounds):
            network.round()
    finally:
        network.close()
    holes = network.scalar(
        "select sum(n) from (select max(cycle) - count(*) as n from cycles group by session union all select 0)"
    )
    doubled = network.scalar("select count(*) - count(distinct session * 1000000000 + cycle) from cycles")
    return {
        "network: rounds (link killed, server hung, server killed)": rounds,
        "network: cycles, with a new sample": f"{network.scalar('select count(*) from cycles')}, {network.alive()}",
        "network: cycles in closed, set-points written": f"{network.closed()}, {network.scalar(WRITTEN)}",
        "network: unsafe writes": network.unsafe(),
        "network: rows lost, doubled": f"{holes}, {doubled}",
        "network: samples again after a hung or killed server [s], most": round(max(network.back_s), 1),
        "network: control again after a kill or a hung server [s], most": round(max(network.control_s), 1),
    }
