"""The simulated plant of a scenario's run: its own drift, disturbances and noise, from its seed."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.protocols import PlantRecord
from adaptive_flot.runner.disturbances import disturbances
from adaptive_flot.runner.plant import SimulatedPlant
from adaptive_flot.runner.scenario import Scenario


def make_plant(scenario: Scenario, seed: int) -> SimulatedPlant:
    """Plant of a run, with its own drift and noise."""
    parameters = scenario.true_parameters()
    x0 = initial_state(scenario, scenario.schedule(seed)[0], parameters[0])
    noise = measurement_noise(scenario, seed)
    accurate = scenario.file.plant.integrator == "accurate"
    return SimulatedPlant(
        scenario.model,
        scenario.dt,
        x0,
        parameters,
        noise,
        disturbances=disturbances(scenario, seed),
        accurate=accurate,
        dead_time=scenario.dead_times,
    )


def initial_state(scenario: Scenario, inputs: FloatArray, parameters: FloatArray) -> FloatArray:
    """State (nx,) in which a run starts: steady at its first inputs (nu,), but for what `initial_state` says."""
    x0 = steady_state(scenario.model, inputs, parameters).state
    columns = [q.column for q in scenario.model.states]
    for column, value in scenario.file.initial_state.items():
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
