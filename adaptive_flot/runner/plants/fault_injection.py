"""Put the faults of a scenario between its plant and its controller; without faults both stay as they are."""

from __future__ import annotations

from adaptive_flot.contracts import AnyController, AnyPlant
from adaptive_flot.runner.plants.faulty_controller import FaultyController
from adaptive_flot.runner.plants.faulty_plant import FaultyPlant
from adaptive_flot.runner.plants.frozen_values import FrozenValues
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


def with_plant_faults(realisation: Realisation, plant: AnyPlant) -> AnyPlant:
    """The plant of a run with the faults of its scenario, and with frozen instruments noticed where it says so."""
    scenario = realisation.scenario
    if scenario.plant_faults:
        plant = FaultyPlant(plant, scenario.plant_faults, scenario.model, scenario.dt, realisation.fault_draws)
    watched = {name: m.frozen_after_s for name, m in scenario.file.measurements.items() if m.frozen_after_s is not None}
    return FrozenValues(plant, scenario.model, watched) if watched else plant


def with_controller_faults(scenario: Scenario, controller: AnyController) -> AnyController:
    """The controller of a run with the faults of its scenario."""
    inside = scenario.controller_faults
    return FaultyController(controller, inside) if inside else controller
