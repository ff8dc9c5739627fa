"""Steady states of many members are those of each alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.greybox.ensemble.steady_states import SteadyStates
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state, steady_state_gradient
from tests.estimators import toys
from tests.greybox.ensemble.test_ensemble import COMPILED, NAMES


@pytest.mark.parametrize("compiled", COMPILED)
def test_members_of_the_cell(model: Model, compiled: bool) -> None:
    """States and their derivatives, each with inputs and parameters of its own."""
    rng = np.random.default_rng(3)
    inputs = rng.uniform([9.05e-4, 1.4e-4, 0.34], [2.17e-3, 2.0e-4, 0.42], (9, 3))
    p = model.parameter_values * rng.uniform(0.97, 1.03, (9, len(model.parameters)))
    members = SteadyStates(replace(model, compiled=compiled), NAMES)
    found, good = members.find(inputs, p)
    gradient = members.gradient(found, inputs, p)
    assert good.all()
    for m in range(9):
        alone = steady_state(model, inputs[m], p[m]).state
        np.testing.assert_allclose(found[m], alone, rtol=1e-10)
        expected = steady_state_gradient(model, alone, inputs[m], p[m], NAMES)
        np.testing.assert_allclose(gradient[m], expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    (again,), _ = members.find(inputs[4:5], p[4:5])
    np.testing.assert_array_equal(again, found[4])


def test_a_member_without_a_steady_state_is_told_apart() -> None:
    """x = sqrt(p + u): none below zero, and none at an input that is no number."""
    found, good = SteadyStates(toys.square()).find(
        np.array([[3.0], [-2.0], [np.nan], [8.0]]), np.tile([1.0, 1.0], (4, 1))
    )
    assert good.tolist() == [True, False, False, True]
    np.testing.assert_allclose(found[[0, 3], 0], [2.0, 3.0], rtol=1e-14)
