"""The noise of a scenario's measurements: where, how large, and drawn."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.scenario.scenario import Scenario


def measured_at(scenario: Scenario) -> npt.NDArray[np.bool_]:
    """Whether each output is measured at the end of each interval (N, ny)."""
    ends = scenario.starts + scenario.dt
    measured = np.zeros((len(ends), len(scenario.model.outputs)), dtype=bool)
    for name, m in scenario.file.measurements.items():
        # the first sampling instant at or after each multiple of the period
        counted = np.floor(np.concatenate([[0.0], ends]) / (m.every_s or scenario.dt) + 1e-9)
        measured[:, scenario.model.index("outputs", name)] = np.diff(counted) > 0
    return measured


def noise_std(scenario: Scenario) -> FloatArray:
    """Standard deviation of the noise of each output (ny,), in its unit; NaN where it is not measured."""
    std = np.full(len(scenario.model.outputs), np.nan)
    for j, q in enumerate(scenario.model.outputs):
        if q.name in scenario.file.measurements:
            std[j] = scenario.file.measurements[q.name].noise_std
    return std


def draw_measurement_noise(scenario: Scenario, generator: np.random.Generator) -> FloatArray:
    """White Gaussian noise of a run (N, ny), each output in its unit; NaN where nothing is measured."""
    std = noise_std(scenario)
    noise = std * generator.standard_normal((len(scenario.starts), std.size))
    return np.where(measured_at(scenario), noise, np.nan)
