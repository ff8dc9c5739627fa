"""Linearisation: the four matrices are the derivatives of the model, in its order and with its names."""

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.linear import linearise
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall


def test_linear_model_is_the_derivative_of_the_cell(model: Model) -> None:
    """A, B, C and D against central differences in every state and input."""
    u, p = np.array([1.5e-3, 1.67e-4, 0.38]), model.parameter_values
    x = steady_state(model, u).state
    system = linearise(model, u)
    assert system.state_labels == list(model.names("states"))
    assert system.input_labels == list(model.names("inputs"))
    assert system.output_labels == list(model.names("outputs"))
    ode, point = FastCall(model.ode), np.append(x, u)

    def both(v: FloatArray) -> FloatArray:
        rates, y, *_ = ode(0.0, v[:9], v[9:], p)
        return np.append(rates, y)

    columns = []
    for i in range(12):
        h = np.zeros(12)
        h[i] = 1e-5 * point[i]
        columns.append((both(point + h) - both(point - h)) / (2 * h[i]))
    found = np.block([[system.A, system.B], [system.C, system.D]]) * point
    expected = np.column_stack(columns) * point
    largest = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / largest, expected / largest, atol=1e-6)
