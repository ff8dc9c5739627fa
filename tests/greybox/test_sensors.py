"""Protects: an effect on a sensor changes what is shown, never what counts as true, whatever the name of its site."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.greybox import FloatArray, Model, Stepper
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.processes.registry import make_model
from adaptive_flot.runner.plants.true_outputs import TrueOutputs

DOCS = Path(__file__).parents[2] / "docs" / "heated_tank"
TANK = "heated_tank.py:make_model", DOCS, [303.0], [2000.0, 10.0]
COLUMNS = "iron-columns", None, [0.02, 0.64], [0.15, 0.5, 1000.0, 500.0, 400.0, 9.8, 1.7, 250.0, 250.0, 0.5, 0.5]


def outputs(model: Model, state: list[float], inputs: FloatArray) -> FloatArray:
    values = Stepper(model, 1.0).outputs_at(np.array(state), 0.0, inputs, model.parameter_values)
    return values[: len(model.outputs)]


@pytest.mark.parametrize(
    ("process", "site", "output"),
    [(TANK, "thermometer", "temperature"), (COLUMNS, "silica_assay", "silica"), (COLUMNS, "iron_assay", "iron")],
    ids=["thermometer", "silica_assay", "iron_assay"],
)
def test_true_outputs_are_free_of_the_error_of_a_sensor_of_any_name(
    process: tuple[str, Path | None, list[float], list[float]], site: str, output: str
) -> None:
    """The site is known by its role: none of these names ends in `_sensor`."""
    name, folder, state, held = process
    nominal, u = make_model(name, folder=folder), np.array(held)
    shifted = nominal.with_effects([Effect(site, "constant", "shift", {"amplitude": 0.25})])
    expected, shown = outputs(nominal, state, u), outputs(shifted, state, u)
    column = nominal.index("outputs", output)
    assert shown[column] - expected[column] == pytest.approx(0.25)  # what is shown carries the error

    np.testing.assert_array_equal(outputs(without_sensor_effects(shifted), state, u), expected)
    true = TrueOutputs(shifted)(shown, 0.0, np.array(state), u, shifted.parameter_values)
    np.testing.assert_array_equal(true, expected)


def test_the_states_of_a_slow_sensor_are_left_out_and_those_of_a_slow_actuator_stay() -> None:
    name, folder, state, held = TANK
    heater = Effect("heating", "lag", "lag", {"amplitude": 1.0}, {"scale": 1000.0})
    slow = Effect("thermometer", "lag", "lag", {"amplitude": 1.0}, {"scale": 300.0})
    model = make_model(name, folder=folder).with_effects([slow, heater])
    true = without_sensor_effects(model)
    assert true.effects == (heater,)
    assert true.names("states") == ("temperature", "heating_by_lag.lagged")
    at = np.array([*state, 0.9, 1.8])
    shown = outputs(model, list(at), np.array(held))
    assert shown[0] == pytest.approx(270.0)  # the sensor still lags behind
    np.testing.assert_array_equal(TrueOutputs(model)(shown, 0.0, at, np.array(held), model.parameter_values), state)


def test_a_model_without_sensor_effects_is_itself() -> None:
    """No second model is built where none is needed, also beside effects on the process."""
    name, folder, _, _ = TANK
    model = make_model(name, folder=folder)
    assert without_sensor_effects(model) is model
    extended = model.with_effects([Effect("heat_loss", "constant", "shift", {"amplitude": 0.1})])
    assert without_sensor_effects(extended) is extended
