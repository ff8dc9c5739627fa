"""The simulated plant of a scenario's run: its own drift, disturbances and noise, from its seed."""

from __future__ import annotations

import numpy as np

from adaptive_flot.contracts import PlantRecord
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.runner.plants.disturbances import disturbances
from adaptive_flot.runner.plants.plant import SimulatedPlant
from adaptive_flot.runner.scenario.scenario import Scenario


def make_plant(scenario: Scenario, seed: int, model: Model | None = None) -> SimulatedPlant:
    """Plant of a run, with its own effects, drift and noise.

    `model` is that of the estimator and the controller, whose parameters the plant's instruments tell.
    """
    parameters = scenario.true_parameters(seed)
    x0 = initial_state(scenario, scenario.plant_model, scenario.schedule(seed)[0], parameters[0])
    noise = measurement_noise(scenario, seed)
    accurate = scenario.file.plant.integrator == "accurate"
    return SimulatedPlant(
        scenario.plant_model,
        scenario.dt,
        x0,
        parameters,
        noise,
        disturbances=disturbances(scenario, seed, model),
        accurate=accurate,
        dead_time=scenario.dead_times,
    )


def initial_state(scenario: Scenario, model: Model, inputs: FloatArray, parameters: FloatArray) -> FloatArray:
    """State (nx,) of a model in which a run starts: steady at its first inputs (nu,) but for `initial_state`."""
    x0 = steady_state(model, inputs, parameters).state
    columns = [q.column for q in model.states]
    for column, value in scenario.file.initial_state.items():
        if column in columns:
            x0[columns.index(column)] = value
    return x0


def simulate_plant(scenario: Scenario, seed: int) -> list[PlantRecord]:
    """What the plant of a run shows under the planned inputs, one record an interval, without any estimator."""
    plant = make_plant(scenario, seed)
    state, records = plant.init(), []
    for inputs in scenario.schedule(seed):
        state, record = plant.apply(state, inputs)
        records.append(record)
    return records


def measurement_noise(scenario: Scenario, seed: int) -> FloatArray:
    """White Gaussian noise of a run (N, ny), the same for every estimator; NaN where nothing is measured."""
    generator = np.random.default_rng([seed, 0])
    std = scenario.noise_std()
    noise = std * generator.standard_normal((len(scenario.starts), std.size))
    return np.where(scenario.measured_at(), noise, np.nan)
