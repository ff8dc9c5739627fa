"""A whole record: row 0 is the initial state itself, the sensitivities of every row are those of the simulation."""

import numpy as np
import pytest

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.stepper import Stepper

ROWS = 40


@pytest.fixture(scope="module")
def record() -> Dataset:
    """Inputs that change at every row, so that a shift by one shows; started at 100 s."""
    inputs = np.random.default_rng(2).uniform([1.2e-3, 1.5e-4, 0.36], [1.8e-3, 1.8e-4, 0.40], (ROWS, 3))
    return Dataset("random", 100.0 + np.arange(ROWS, dtype=float), 1.0, inputs, np.full((ROWS, 6), np.nan))


@pytest.fixture(scope="module")
def start(model: Model) -> FloatArray:
    return steady_state(model, np.array([1.5e-3, 1.67e-4, 0.38])).state


def test_row_k_holds_the_inputs_of_the_interval_that_ends_there(
    model: Model, record: Dataset, start: FloatArray
) -> None:
    """Row 0: outputs of the initial state with the inputs of row 0; row k: after a step with the inputs of row k."""
    simulator, stepper, p = RecordSimulator(model, 1.0), Stepper(model, 1.0), model.parameter_values
    outputs = simulator.outputs(record, start, p)
    ny = len(model.outputs)
    np.testing.assert_allclose(outputs[0], stepper.outputs_at(start, 100.0, record.inputs[0], p)[:ny])
    x = start
    for k in range(1, ROWS):
        x, y, _ = stepper.call(x, 99.0 + k, record.inputs[k], p)
        np.testing.assert_allclose(outputs[k], y, rtol=1e-12)
    np.testing.assert_allclose(simulator.last_state(record, start, p), x, rtol=1e-12)


def test_sensitivities_of_every_row(model: Model, record: Dataset, start: FloatArray) -> None:
    """For C and for the initial level, which is given a part that moves with C; against central differences."""
    simulator, p, i = RecordSimulator(model, 1.0), model.parameter_values, model.index("parameters", "C")
    x0_gradient = np.zeros((9, 2))
    x0_gradient[1] = [5.0, 1.0]
    outputs, gradient, last = simulator.sensitivities(record, start, p, ["C"], x0_gradient)
    np.testing.assert_allclose(outputs, simulator.outputs(record, start, p), rtol=1e-12)

    def run(c: float, level: float) -> tuple[FloatArray, FloatArray]:
        q, x0 = p.copy(), start.copy()
        q[i] += c
        x0[1] += level + 5.0 * c
        return simulator.outputs(record, x0, q), simulator.last_state(record, x0, q)

    for j, (c, level) in enumerate([(1e-8, 0.0), (0.0, 1e-6)]):
        difference, last_difference = (
            (a - b) / (2 * (c + level)) for a, b in zip(run(c, level), run(-c, -level), strict=True)
        )
        np.testing.assert_allclose(last[:, j], last_difference, rtol=1e-5, atol=1e-7 * np.abs(last_difference).max())
        error = np.abs(gradient[:, :, j] - difference).max(axis=0)
        assert np.all(error <= 1e-5 * np.abs(difference).max(axis=0))
        assert np.any(gradient[0, :, j] != 0)
