"""What a scenario's plant imposes beside the controller, and what its instruments know of it at each sample."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.plants.plant import Disturbances
from adaptive_flot.runner.scenario.keys import DisturbancePart
from adaptive_flot.runner.scenario.scenario import Scenario

EXACT = DisturbancePart()


def disturbances(scenario: Scenario, seed: int, model: Model | None = None) -> Disturbances:
    """Disturbances of a run, its measurement noise drawn from the seed, apart from that of the outputs.

    What is known of parameters comes as the parameter vector of `model`, that of estimator and controller; default the
    scenario's model.
    """
    generator = np.random.default_rng([seed, 3])
    schedule, imposed = scenario.schedule(seed), scenario.imposed
    inputs = np.full_like(schedule, np.nan)
    inputs[:, imposed] = schedule[:, imposed]
    shown = inputs.copy()
    for j in imposed:
        part = scenario.file.disturbances.get(scenario.model.inputs[j].column, EXACT)
        shown[:, j] = known(scenario, part, inputs[:, j], float(inputs[0, j]), generator)
    return Disturbances(inputs, shown, _parameters(scenario, seed, model or scenario.model, generator))


def _parameters(scenario: Scenario, seed: int, model: Model, generator: np.random.Generator) -> FloatArray | None:
    inputs = [q.column for q in scenario.model.inputs]
    if not scenario.measured_parameters:
        return None
    true, nominal = scenario.true_parameters(seed), model.parameter_values
    found = np.tile(nominal, (len(true), 1))
    for key, part in scenario.file.disturbances.items():
        if key not in inputs:
            i, j = model.index("parameters", key), scenario.plant_model.index("parameters", key)
            found[:, i] = known(scenario, part, true[:, j], float(nominal[i]), generator)
    return found


def known(
    scenario: Scenario, part: DisturbancePart, true: FloatArray, assumed: float, generator: np.random.Generator
) -> FloatArray:
    """What is known of a disturbance at the end of each interval (N,).

    Parameters
    ----------
    scenario
        For its sampling interval.
    part
        How it is measured.
    true
        Value in each interval (N,).
    assumed
        Value that is taken for it before the first measurement is known, or where there is none.
    generator
        Draws the noise.
    """
    if not part.measured:
        return np.full(len(true), assumed)
    measured = true + part.noise_std * generator.standard_normal(len(true))
    every = round((part.every_s or scenario.dt) / scenario.dt)
    rows = np.arange(len(true)) - round(part.dead_time_s / scenario.dt)
    taken = (rows + 1) // every * every - 1  # measurements are taken at whole multiples of the period
    return np.where(taken >= 0, measured[np.maximum(taken, 0)], assumed)
