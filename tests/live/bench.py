"""A link and its plant in lockstep, in one process."""

from __future__ import annotations

import copy
from collections.abc import Callable

from adaptive_flot.live.link.cycle import Cycle, CycleState
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.plant.direct import DirectPlant, Distort, as_told, run_direct
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store.memory import Memory
from adaptive_flot.runner.scenario.realisation import Realisation

__all__ = ["INITIAL", "Bench", "Distort", "as_told"]
INITIAL = 12
"""Intervals of the short scenario's initial estimate."""


class Bench:
    """A link and its plant; what `memory` is given, it stores."""

    def __init__(self, cycle: Cycle, distort: Distort = as_told, memory: Memory | None = None) -> None:
        self.cycle = cycle
        self.direct = DirectPlant(TestPlant(Realisation(cycle.link.scenario, 1)), distort)
        self.memory = memory
        self.state: CycleState = cycle.start()

    def restart(self, memory: Memory) -> None:
        """The link's process ends, and another one starts."""
        self.memory = memory
        self.state = self.cycle.start(None if memory.resumed is None else memory.resumed.prior)

    def copy(self, distort: Distort) -> Bench:
        """The same link and plant from here on, with another instrument fault."""
        made = copy.copy(self)
        made.direct = self.direct.copy(distort)
        return made

    def step(self, snapshot: Snapshot) -> Outcome:
        self.state, outcome = self.cycle.step(self.state, snapshot)
        if self.memory:
            self.memory.store(snapshot, outcome, self.state.estimation.began, {})
        return outcome

    def run(self, intervals: int, before: Callable[[int], None] = lambda k: None) -> list[Outcome]:
        return [outcome for _, outcome, _ in run_direct(self.direct, self.step, intervals, before)]

    def to_closed(self) -> None:
        """Past the initial estimate, and the operator lets the link go to closed."""
        self.run(INITIAL + 3)
        self.direct.operate("switch", Mode.CLOSED)
        assert self.run(4)[-1].mode is Mode.CLOSED
