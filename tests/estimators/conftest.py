"""Records of the flotation cell that several tests share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from adaptive_flot.contracts import AnyEstimator, Estimate, Prior, Sample, Setup, full_parameters
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.trajectory import Trajectory

NOISE_STD = 1e-3
ROWS = 60


@dataclass(frozen=True)
class CellCase:
    """One minute of the cell with changing inputs, drifting n and C, and a noisy grade."""

    setup: Setup
    x0: FloatArray
    inputs: FloatArray
    truth: Trajectory
    samples: tuple[Sample, ...]
    prior: Prior


@pytest.fixture(scope="session")
def cell_case(model: Model, fast: Stepper) -> CellCase:
    generator = np.random.default_rng(11)
    air = np.repeat(generator.uniform(9.05e-4, 2.17e-3, ROWS // 6), 6)
    level = np.repeat(generator.uniform(0.33, 0.42, ROWS // 20), 20)
    inputs = np.column_stack([air, np.full(ROWS, 1.67e-4), level])
    p = np.tile(model.parameter_values, (ROWS, 1))
    for name in ("n", "C"):
        p[:, model.index("parameters", name)] *= np.linspace(1.0, 1.05, ROWS)
    x0 = steady_state(model, inputs[0]).state
    truth = fast.simulate(x0, inputs, p)
    outputs = np.full_like(truth.outputs, np.nan)
    grade, level_row = model.index("outputs", "concentrate_grade"), model.index("outputs", "level")
    for row in (grade, level_row):
        outputs[:, row] = truth.outputs[:, row] + NOISE_STD * generator.standard_normal(ROWS)
    samples = tuple(Sample(float(t), u, y) for t, u, y in zip(truth.time, inputs, outputs, strict=True))
    setup = Setup(model, 1.0, ("growth_exponent", "coalescence_rate"), ("concentrate_grade",))
    nominal = model.parameter_values[model.indices("parameters", setup.parameters)]
    prior = Prior(0.0, x0, nominal, np.diag((0.01 * nominal) ** 2), np.array([NOISE_STD]))
    return CellCase(setup, x0, inputs, truth, samples, prior)


def replay(estimator: AnyEstimator, prior: Prior, samples: tuple[Sample, ...]) -> list[Estimate]:
    """Estimates of every sample."""
    state, estimates = estimator.init(prior), []
    for sample in samples:
        state, estimate = estimator.update(state, sample)
        estimates.append(estimate)
    return estimates


def full(setup: Setup, values: FloatArray) -> FloatArray:
    """Parameter vector of a setup with the adapted entries replaced."""
    return full_parameters(setup.model, setup.parameters, values)
