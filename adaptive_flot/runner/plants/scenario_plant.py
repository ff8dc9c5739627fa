"""The simulated plant of a run, made from its scenario and seed."""

from __future__ import annotations

from adaptive_flot.contracts import PlantRecord
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.runner.plants.plant import SimulatedPlant
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


def make_plant(realisation: Realisation, model: Model | None = None) -> SimulatedPlant:
    """Plant of a run, with its own effects, drift and noise.

    `model` is that of the estimator and the controller: the plant's instruments show its parameters.
    """
    scenario = realisation.scenario
    return SimulatedPlant(
        scenario.plant_model,
        scenario.dt,
        initial_state(scenario, scenario.plant_model, realisation.schedule[0], realisation.parameters[0]),
        realisation.parameters,
        realisation.measurement_noise,
        disturbances=realisation.disturbances(model),
        accurate=scenario.file.plant.integrator == "accurate",
        dead_time=scenario.dead_times,
    )


def initial_state(scenario: Scenario, model: Model, inputs: FloatArray, parameters: FloatArray) -> FloatArray:
    """State (nx,) of a model in which a run starts: steady at its first inputs (nu,) but for `initial_state`."""
    return with_given_states(scenario, model, steady_state(model, inputs, parameters).state)


def with_given_states(scenario: Scenario, model: Model, x0: FloatArray) -> FloatArray:
    """A steady state (nx,) with the states that the scenario gives."""
    columns = [q.column for q in model.states]
    for column, value in scenario.file.initial_state.items():
        if column in columns:
            x0[columns.index(column)] = value
    return x0


def simulate_plant(realisation: Realisation) -> list[PlantRecord]:
    """What the plant of a run shows under the planned inputs, one record an interval, without any estimator."""
    plant = make_plant(realisation)
    state, records = plant.init(), []
    for inputs in realisation.schedule:
        state, record = plant.apply(state, inputs)
        records.append(record)
    return records
