"""An auditor that knows the faults, and judges every write that the plant took. It shares no code with the link."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from sqlalchemy import Engine, text

from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.plant.control import PanelState
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.live.faults import NEVER_TRUE, InstrumentFaults

ROUNDING = 1e-6


@dataclass
class Audit:
    """What the auditor has counted.

    Attributes
    ----------
    unsafe
        Writes that the plant took though they were unsafe, by reason.
    writes, cycles
        All writes that the plant took, all cycles.
    bump
        Largest change of an input in the interval after a change of mode, in rate limits.
    shed_cycles
        Cycles from the first bad one to shedding, one each time that the link shed for bad cycles.
    """

    scenario: Scenario
    stale_s: float
    unsafe: Counter[str] = field(default_factory=Counter)
    writes: int = 0
    cycles: int = 0
    bump: float = 0.0
    shed_cycles: list[int] = field(default_factory=list)
    modes: Counter[str] = field(default_factory=Counter)
    _bad: int = 0
    _mode: Mode = Mode.MONITOR
    _acting: dict[str, float] = field(default_factory=dict)
    _changed: bool = False

    def cycle(
        self, panel: PanelState, snapshot: Snapshot, outcome: Outcome, faults: InstrumentFaults, taken: bool, fine: bool
    ) -> None:
        """Judge a cycle: the panel before its writes, what was told and done, and whether the plant took the writes."""
        self.cycles += 1
        self.modes[outcome.mode.name.lower()] += 1
        if taken and outcome.writes:
            self.writes += len(outcome.writes)
            self.unsafe.update(self._reasons(panel, snapshot, outcome, faults, fine))
        self._used(outcome, faults)
        self._bad = 0 if not outcome.faults else self._bad + 1
        if outcome.mode is Mode.SHED and self._mode is Mode.CLOSED and "bad cycles" in outcome.reason:
            self.shed_cycles.append(self._bad)
        self._changed, self._mode = outcome.mode is not self._mode, outcome.mode

    def interval(self, panel: PanelState) -> None:
        """After an interval of the plant: how far the inputs moved."""
        assert self.scenario.limits is not None
        for name, value in panel.acting.items():
            moved = abs(value - self._acting.get(name, value)) / self.scenario.limits.moves[name]
            if moved > 1 + ROUNDING:
                self.unsafe["the plant moved faster than the rate limit"] += 1
            if self._changed:
                self.bump = max(self.bump, moved)
        self._acting, self._changed = dict(panel.acting), False

    def _reasons(
        self, panel: PanelState, snapshot: Snapshot, outcome: Outcome, faults: InstrumentFaults, fine: bool
    ) -> list[str]:
        limits = self.scenario.limits
        assert limits is not None
        found = [] if outcome.mode is Mode.CLOSED and panel.switch is Mode.CLOSED and panel.active else ["wrong mode"]
        if not (fine and snapshot.alive and snapshot.in_time and snapshot.written):
            found.append("in a bad cycle")
        for name, value in outcome.writes.items():
            (low, high), (own_low, own_high) = limits.inputs[name], panel.limits[name]
            if not max(low, own_low) <= value <= min(high, own_high):
                found.append("outside clamps")
            if abs(value - panel.acting[name]) > limits.moves[name] * (1 + ROUNDING):
                found.append("faster than the rate limit")
        for name in [q.name for q in self.scenario.model.inputs] + [f"acting {n}" for n in limits.inputs]:
            if faults.acting.get(name) in NEVER_TRUE:
                found.append(f"from a {faults.acting[name]} input")
            elif snapshot.time - faults.good_at.get(name, -np.inf) > self.stale_s + ROUNDING:
                found.append("from a stale input")
        return found

    def _used(self, outcome: Outcome, faults: InstrumentFaults) -> None:
        """Values that were no measurements and were taken for one."""
        if outcome.sample is None:
            return
        for j, q in enumerate(self.scenario.model.outputs):
            if faults.acting.get(q.name) in NEVER_TRUE and np.isfinite(outcome.sample.outputs[j]):
                self.unsafe[f"a {faults.acting[q.name]} value was taken for a measurement"] += 1


@dataclass(frozen=True)
class Rows:
    """Rows of a database that should be there, and those that are not or are there twice."""

    cycles: int
    lost: int
    doubled: int


def count_rows(engine: Engine, stepped: dict[int, int], estimates: int) -> Rows:
    """Compare a database with the cycles that each session made, and with the number of estimates."""
    with engine.connect() as connection:
        stored = {s: n for s, n in connection.execute(text("select session, count(*) from cycles group by session"))}
        numbers = "select count(*) from (select distinct session, cycle from cycles)"
        distinct = connection.execute(text(numbers)).scalar() or 0
        known = connection.execute(text("select count(*) from estimates")).scalar() or 0
    total = sum(stored.values())
    lost = sum(max(0, n - stored.get(s, 0)) for s, n in stepped.items()) + max(0, estimates - known)
    return Rows(total, lost, total - distinct + max(0, known - estimates))
