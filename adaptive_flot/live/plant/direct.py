"""The test plant without a network: it tells and takes what the server and the client would, one call an interval."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from adaptive_flot.contracts import PlantRecord
from adaptive_flot.live.outcome import Outcome, Written
from adaptive_flot.live.plant.process import ProcessState, TestPlant
from adaptive_flot.live.safety.tag_value import Quality, TagValue
from adaptive_flot.live.snapshot import Snapshot

STARTED = 1_000_000.0
"""Plant's clock at the start of the scenario [s]."""
Distort = Callable[[str, TagValue, int], TagValue | None]
"""Changes what a tag tells in an interval; None: it keeps what it told."""


def as_told(name: str, tag: TagValue, row: int) -> TagValue | None:
    """The value as it is."""
    del name, row
    return tag


class DirectPlant:
    """A test plant beside the cycle, in the same process.

    Parameters
    ----------
    plant
        The plant.
    distort
        Changes what tags tell.

    Attributes
    ----------
    state
        Plant and panel after the last interval.
    clock
        What is added to the plant's clock [s]; a test lets it jump.
    """

    def __init__(self, plant: TestPlant, distort: Distort = as_told) -> None:
        self.plant, self.distort = plant, distort
        self.state: ProcessState = plant.init()
        self.clock = STARTED
        self._tags: dict[str, TagValue] = {}

    def copy(self, distort: Distort) -> DirectPlant:
        """The same plant from here on, whose tags are changed by another function."""
        made = copy.copy(self)
        made.distort, made._tags = distort, dict(self._tags)
        return made

    def operate(self, name: str, value: float) -> None:
        """The operator sets the switch, a limit or a local set-point; ValueError where the panel refuses."""
        panel, why = self.plant.panel.operated(self.state.panel, name, value)
        if why:
            raise ValueError(why)
        self.state = replace(self.state, panel=panel)

    def interval(self) -> PlantRecord:
        """One interval of the plant."""
        self.state, record = self.plant.interval(self.state)
        model, sample = self.plant.scenario.model, record.sample
        told = dict(zip(model.names("inputs"), sample.inputs, strict=True))
        told |= {n: v for n, v in zip(model.names("outputs"), sample.outputs, strict=True) if math.isfinite(v)}
        for name, value in told.items():
            self._tell(name, float(value), sample.time)
        for late in sample.delayed:
            self._tell(late.output, late.value, late.time)
        if sample.parameters is not None:
            for i in self.plant.scenario.measured_parameters:
                self._tell(f"parameter.{model.parameters[i].name}", float(sample.parameters[i]), sample.time)
        for name, value in self.state.panel.acting.items():
            self._tell(f"acting {name}", value, sample.time)
        return record

    def snapshot(self, *, alive: bool = True, in_time: bool = True, written: bool = True) -> Snapshot:
        """What the link knows now."""
        panel, moved = self.state.panel, self.plant.limits
        return Snapshot(
            self.clock + self.state.row * self.plant.scenario.dt,
            alive,
            {name: tag for name, tag in self._tags.items() if not name.startswith("acting ")},
            {name: self._tags[f"acting {name}"] for name in moved if f"acting {name}" in self._tags},
            dict(panel.limits),
            panel.switch,
            panel.active,
            in_time,
            written,
        )

    def take(self, outcome: Outcome) -> dict[str, Written]:
        """Heartbeat, request and set-points of a cycle."""
        panel = self.plant.panel.beat(self.state.panel, outcome.number)
        panel = self.plant.panel.asked(panel, outcome.asks_control)
        why = ""
        if outcome.writes:
            panel, why = self.plant.panel.remote(panel, outcome.writes)
        self.state = replace(self.state, panel=panel)
        return {name: Written(value, math.nan if why else value, why) for name, value in outcome.writes.items()}

    def _tell(self, name: str, value: float, time: float) -> None:
        told = self.distort(name, TagValue(value, Quality.GOOD, self.clock + time), self.state.row)
        if told is not None:
            self._tags[name] = told


def run_direct(
    direct: DirectPlant,
    step: Callable[[Snapshot], Outcome],
    intervals: int,
    before: Callable[[int], None] = lambda k: None,
) -> list[tuple[Snapshot, Outcome, Mapping[str, Written]]]:
    """Plant and link in lockstep; `before` is called with the number of each interval before it."""
    made: list[tuple[Snapshot, Outcome, Mapping[str, Written]]] = []
    well = True
    for k in range(intervals):
        before(k)
        direct.interval()
        snapshot = direct.snapshot(written=well)
        outcome = step(snapshot)
        results = direct.take(outcome)
        well = not any(w.problem for w in results.values())
        made.append((snapshot, outcome, results))
    return made
