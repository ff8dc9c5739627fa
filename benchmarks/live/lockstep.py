"""Many cycles of link and plant in one process, with storage: the link's own code, without the network."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adaptive_flot.contracts import Prior
from adaptive_flot.live.link.cycle import Cycle, CycleState
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.plant.direct import DirectPlant
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.runner.scenario.realisation import Realisation
from benchmarks.live.audit import Audit, Rows, count_rows
from benchmarks.live.faults import Event, InstrumentFaults, draw_event

WARM = 1000
"""Cycles before the memory of the process is taken as the start."""
PAUSE, DOWN = 6, 2
"""Cycles until the operator turns the switch down after a shedding, and how long it stays there."""


@dataclass(frozen=True)
class Found:
    """What a run found.

    Attributes
    ----------
    seconds
        Of each cycle, by the clock and of the processor (cycles, 2).
    solves
        Whether a solver ran in it (cycles,).
    load
        Average number of processes that wanted a core in a minute, least and most during the run.
    """

    audit: Audit
    rows: Rows
    seconds: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    solves: np.ndarray[tuple[int], np.dtype[np.bool_]]
    grown_mb: float
    counted: dict[str, int]
    sessions: int
    refused: int
    load: tuple[float, float]


class Lockstep:
    """Plant, link and operator.

    Parameters
    ----------
    link
        The link file and its scenario, as long as the run.
    folder
        For the database.
    seed
        Of the faults.
    """

    def __init__(self, link: Link, folder: Path, seed: int) -> None:
        self.link, self.folder = link, folder
        self.generator = np.random.default_rng(seed)
        self.faults = InstrumentFaults(np.random.default_rng(seed + 1))
        self.direct = DirectPlant(TestPlant(Realisation(link.scenario, 1)), self.faults)
        self.cycle = Cycle(link)
        self.audit = Audit(link.scenario, 10 * link.scenario.dt)
        self.stepped: dict[int, int] = {}
        self.estimates = 0
        self.counted: dict[str, int] = {}
        self._event: tuple[Event, int] | None = None
        self._well, self._in_time, self._wait = True, True, 0
        self._start()

    def _start(self) -> None:
        self.memory = Memory(open_database("sqlite:///bench.sqlite", self.folder), self.link)
        prior: Prior | None = None if self.memory.resumed is None else self.memory.resumed.prior
        self.state: CycleState = self.cycle.start(prior)

    def run(self, cycles: int) -> Found:
        """Run so many cycles."""
        seconds, solves, begin = np.zeros((cycles, 2)), np.zeros(cycles, dtype=bool), 0.0
        loads: list[float] = []
        for k in range(cycles):
            begin = resident_mb() if k == WARM else begin
            if k % WARM == 0:
                loads.append(os.getloadavg()[0])
            self._next_event()
            self.direct.interval()
            self.audit.interval(self.direct.state.panel)
            seconds[k], solves[k] = self._one()
            self._operate()
        grown = resident_mb() - begin if cycles > WARM else float("nan")
        engine = open_database("sqlite:///bench.sqlite", self.folder)
        rows = count_rows(engine, self.stepped, self.estimates)
        counted = {**self.counted, **self.faults.counted}
        refused = self.direct.state.panel.refused
        load = min(loads), max(loads)
        return Found(self.audit, rows, seconds, solves, grown, counted, len(self.stepped), refused, load)

    def _next_event(self) -> None:
        kind, left = self._event or (None, 0)
        self._event = None if kind is None or left <= 1 else (kind, left - 1)
        if self._event is not None:
            return
        self._event = draw_event(self.generator)
        if self._event is None:
            return
        kind = self._event[0]
        self.counted[kind] = self.counted.get(kind, 0) + 1
        if kind == "link killed":
            self.memory.close()
            self._start()
        elif kind == "clock jump":
            self.direct.clock += float(self.generator.normal(0.0, 60.0))
        elif kind == "server killed":
            panel = replace(self.direct.state.panel, active=False, asked=False, remote={})
            self.direct.state = replace(self.direct.state, panel=panel)

    def _one(self) -> tuple[tuple[float, float], bool]:
        """One cycle; how long it took by the clock and of the processor [s], and whether a solver ran."""
        kind = None if self._event is None else self._event[0]
        cut_off = kind in ("hung server", "server killed")
        snapshot = self.direct.snapshot(alive=not cut_off, in_time=self._in_time, written=self._well)
        begin, used = time.perf_counter(), time.thread_time()
        self.state, outcome = self.cycle.step(self.state, snapshot)
        self.memory.store(snapshot, outcome, self.state.estimation.began, {})
        seconds = time.perf_counter() - begin, time.thread_time() - used
        self.stepped[self.memory.session] = outcome.number
        self.estimates += outcome.estimate is not None
        before, late, refusing = self.direct.state.panel, kind == "overrun", kind == "write refused"
        self._in_time = not late
        taken = self._take(outcome, cut_off, late, refusing)
        self._well = taken or not outcome.writes
        self.audit.cycle(before, snapshot, outcome, self.faults, taken and not late, not cut_off)
        solves = outcome.decision is not None and bool(np.isfinite(outcome.decision.solve_seconds))
        return seconds, solves

    def _take(self, outcome: Outcome, cut_off: bool, late: bool, refusing: bool) -> bool:
        """What reaches the plant; whether it took the set-points."""
        if cut_off:
            return False
        told = replace(outcome, writes={}) if late or refusing else outcome
        results = self.direct.take(told)
        return not refusing and all(not w.problem for w in results.values()) and (not late or not outcome.writes)

    def _operate(self) -> None:
        """The operator lets the link go to closed, and again some time after it has shed or restarted."""
        mode, armed = self.state.modes.mode, self.state.modes.armed
        if self.state.estimation.estimate is None or (armed and mode is not Mode.SHED):
            self._wait = 0
            if self.state.estimation.estimate is not None:
                self.direct.operate("switch", Mode.CLOSED)
            return
        self._wait += 1
        down = PAUSE <= self._wait < PAUSE + DOWN
        self.direct.operate("switch", Mode.MONITOR if down else Mode.CLOSED)


def resident_mb() -> float:
    """Memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6
