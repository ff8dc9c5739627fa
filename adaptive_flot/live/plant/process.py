"""The scenario's plant, one interval after the other, with the inputs that the panel lets act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from adaptive_flot.contracts import PlantRecord
from adaptive_flot.errors import LinkError
from adaptive_flot.live.plant.control import Panel, PanelState
from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.runner.plants.fault_injection import with_plant_faults
from adaptive_flot.runner.plants.scenario_plant import make_plant
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


@dataclass(frozen=True)
class ProcessState:
    """Interval to come, the plant's state, the panel, and the local set-points that the scenario planned last."""

    row: int
    plant: Any
    panel: PanelState
    planned: Mapping[str, float]


class TestPlant:
    """A scenario's plant with faults, noise and drift, and a panel in front of the inputs that its limits name.

    The scenario's planned inputs are the operator's local set-points, as long as nobody else changes them.

    Parameters
    ----------
    realisation
        Scenario and seed.

    Raises
    ------
    LinkError
        The scenario has no limits: nothing could be written.
    """

    __test__ = False  # no test case, whatever its name begins with

    def __init__(self, realisation: Realisation) -> None:
        scenario = realisation.scenario
        self.scenario = scenario
        self.rows = len(scenario.starts)
        self.limits = write_limits(scenario)
        self.panel = Panel(self.limits)
        self._realisation = realisation
        self._plant = with_plant_faults(realisation, make_plant(realisation))
        self._moved = {name: scenario.model.index("inputs", name) for name in self.limits}

    def init(self) -> ProcessState:
        """At the start of the scenario the operator has control."""
        first = self._planned(0)
        return ProcessState(0, self._plant.init(), self.panel.start(first), first)

    def interval(self, state: ProcessState) -> tuple[ProcessState, PlantRecord]:
        """One sampling interval; LinkError after the end of the scenario."""
        k = state.row
        if k >= self.rows:
            raise LinkError(f"{self.scenario.name}: the scenario is over after {self.rows} intervals")
        planned = self._planned(k)
        panel = self._follow_plan(state, planned)
        panel = self.panel.interval(panel)
        inputs = self._realisation.schedule[k].copy()
        for name, j in self._moved.items():
            inputs[j] = panel.acting[name]
        plant, record = self._plant.apply(state.plant, inputs)
        return ProcessState(k + 1, plant, panel, planned), record

    def _planned(self, row: int) -> dict[str, float]:
        return {name: float(self._realisation.schedule[row, j]) for name, j in self._moved.items()}

    def _follow_plan(self, state: ProcessState, planned: Mapping[str, float]) -> PanelState:
        changed = {name: value for name, value in planned.items() if value != state.planned[name]}
        if not changed or state.panel.active:
            return state.panel
        return replace(state.panel, local={**state.panel.local, **changed})


def write_limits(scenario: Scenario) -> dict[str, WriteLimit]:
    """Clamps and rate limit of each moved input of a scenario; LinkError where it has no limits."""
    limits = scenario.limits
    if limits is None:
        raise LinkError(f"{scenario.path}: has no limits, so that nothing may be written; add the key 'limits'")
    return {
        name: WriteLimit(float(low), float(high), float(limits.moves[name]))
        for name, (low, high) in limits.inputs.items()
    }


def measured_outputs(scenario: Scenario) -> tuple[str, ...]:
    """Names of the outputs that the scenario measures."""
    return tuple(q.name for q in scenario.model.outputs if q.name in scenario.file.measurements)
