"""Put the faults of a scenario between its plant and its controller; without faults both stay as they are."""

from __future__ import annotations

import numpy as np

from adaptive_flot.contracts import AnyController, AnyPlant
from adaptive_flot.runner.plants.faulty_controller import FaultyController
from adaptive_flot.runner.plants.faulty_plant import FaultyPlant
from adaptive_flot.runner.plants.frozen_values import FrozenValues
from adaptive_flot.runner.scenario.faults import ControllerFault
from adaptive_flot.runner.scenario.scenario import Scenario


def with_faults(
    scenario: Scenario, seed: int, plant: AnyPlant, controller: AnyController
) -> tuple[AnyPlant, AnyController]:
    """Plant and controller of a run with the faults of its scenario; chance is drawn from the seed, fault by fault."""
    around = [fault for fault in scenario.file.faults if not isinstance(fault, ControllerFault)]
    if around:
        rows = len(scenario.starts)
        draws = np.stack([np.random.default_rng([seed, 4, i]).random((rows, 2)) for i in range(len(around))], axis=1)
        plant = FaultyPlant(plant, around, scenario.model, scenario.dt, draws)
    watched = {name: m.frozen_after_s for name, m in scenario.file.measurements.items() if m.frozen_after_s is not None}
    if watched:
        plant = FrozenValues(plant, scenario.model, watched)
    return plant, with_controller_faults(scenario, controller)


def with_controller_faults(scenario: Scenario, controller: AnyController) -> AnyController:
    """The controller of a run with the faults of its scenario."""
    inside = [fault for fault in scenario.file.faults if isinstance(fault, ControllerFault)]
    return FaultyController(controller, inside) if inside else controller
