"""What a plant imposes beside the controller, and what its instruments know of it at each sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.scenario.keys import DisturbancePart
from adaptive_flot.runner.scenario.scenario import Scenario

EXACT = DisturbancePart()


@dataclass(frozen=True)
class Disturbances:
    """What acts on a plant beside the controller, and what its instruments show of it, a row an interval.

    Attributes
    ----------
    inputs
        Inputs (N, nu) that are not the controller's to choose, NaN where they are.
    shown
        The same as measured or assumed, for `Sample.inputs`.
    parameters
        Known parameter vectors (N, np), for `Sample.parameters`; None where no parameter is measured.
    """

    inputs: FloatArray
    shown: FloatArray
    parameters: FloatArray | None = None


def draw_disturbances(
    scenario: Scenario, schedule: FloatArray, true: FloatArray, model: Model, generator: np.random.Generator
) -> Disturbances:
    """Disturbances of a run; the noise of inputs is drawn first, then that of parameters, in the order of the file.

    Parameters
    ----------
    scenario
        The scenario.
    schedule
        Planned inputs (N, nu).
    true
        True parameters of the plant's model (N, np).
    model
        That of estimator and controller: known parameters come as its parameter vector.
    generator
        Draws the noise of the measurements.
    """
    imposed = scenario.imposed
    inputs = np.full_like(schedule, np.nan)
    inputs[:, imposed] = schedule[:, imposed]
    shown = inputs.copy()
    for j in imposed:
        part = scenario.file.disturbances.get(scenario.model.inputs[j].column, EXACT)
        shown[:, j] = known_values(part, inputs[:, j], float(inputs[0, j]), scenario.dt, generator)
    return Disturbances(inputs, shown, _known_parameters(scenario, true, model, generator))


def _known_parameters(
    scenario: Scenario, true: FloatArray, model: Model, generator: np.random.Generator
) -> FloatArray | None:
    inputs = [q.column for q in scenario.model.inputs]
    if not scenario.measured_parameters:
        return None
    nominal = model.parameter_values
    known = np.tile(nominal, (len(true), 1))
    for key, part in scenario.file.disturbances.items():
        if key not in inputs:
            i, j = model.index("parameters", key), scenario.plant_model.index("parameters", key)
            known[:, i] = known_values(part, true[:, j], float(nominal[i]), scenario.dt, generator)
    return known


def known_values(
    part: DisturbancePart, true: FloatArray, assumed: float, dt: float, generator: np.random.Generator
) -> FloatArray:
    """What is known of a disturbance at the end of each interval (N,).

    Parameters
    ----------
    part
        How it is measured.
    true
        Value in each interval (N,).
    assumed
        Value that is taken for it before the first measurement is known, or where there is none.
    dt
        Sampling interval [s].
    generator
        Draws the noise.
    """
    if not part.measured:
        return np.full(len(true), assumed)
    measured = true + part.noise_std * generator.standard_normal(len(true))
    every = round((part.every_s or dt) / dt)
    rows = np.arange(len(true)) - round(part.dead_time_s / dt)
    taken = (rows + 1) // every * every - 1  # measurements are taken at whole multiples of the period
    return np.where(taken >= 0, measured[np.maximum(taken, 0)], assumed)
