"""A column in another unit than its name says is refused with the unit that fits; what is merely odd passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.data.wrong_unit import check_unit
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.likely_unit import off_by_a_unit
from tests.discovery.heated import heated_tank

VALUES = {
    "air_flow_m3_s": 1.5e-3,
    "feed_flow_m3_s": 1.67e-4,
    "level_setpoint_m": 0.38,
    "concentrate_grade": 0.23,
    "recovery": 0.85,
    "level_m": 0.38,
    "concentrate_flow_m3_s": 2e-6,
}
"""A sound row of the cell."""


def record(**factors: float) -> pd.DataFrame:
    columns = {c: np.full(50, v * factors.get(c, 1.0)) for c, v in VALUES.items()}
    return pd.DataFrame({"time_s": 1.0 * np.arange(50), **columns})


@pytest.mark.parametrize(
    ("column", "factor", "unit"),
    [
        ("concentrate_grade", 100.0, "%"),
        ("recovery", 100.0, "%"),
        ("level_m", 1000.0, "mm"),
        ("level_m", 100.0, "cm"),
        ("level_setpoint_m", 1000.0, "mm"),
        ("air_flow_m3_s", 60_000.0, "L/min"),
        ("feed_flow_m3_s", 60_000.0, "L/min"),
        ("feed_flow_m3_s", 3600.0, "m3/h"),
        ("concentrate_flow_m3_s", 60_000.0, "L/min"),
    ],
)
def test_another_unit_is_named(model: Model, column: str, factor: float, unit: str) -> None:
    with pytest.raises(RangeError) as caught:
        read_dataset(record(**{column: factor}), model)
    message = str(caught.value)
    assert message.startswith("DataFrame: ") and f"in {unit} that would be" in message
    assert column.startswith(message.split(": ")[1].split(" ")[0])


def test_a_sound_record_and_one_with_some_wrong_values_pass(model: Model) -> None:
    """One spike, one sensor with an offset, noise about zero: no matter of units."""
    odd = record()
    odd.loc[3, "concentrate_grade"] = 23.0
    odd["level_m"] += 0.11
    assert read_dataset(odd, model).outputs[3, 0] == 23.0


def test_a_record_without_any_measurement_of_an_output_passes(model: Model) -> None:
    assert "recovery" not in read_dataset(record(recovery=np.nan), model).measured(model)


def test_degrees_in_a_column_of_kelvin_are_named_by_the_range_of_the_state() -> None:
    """The output has no range of its own; the state of the same name has."""
    tank = heated_tank()
    t = 30.0 * np.arange(1, 51)
    kelvin = pd.DataFrame({"time_s": t, "power_W": 1e3, "fan_speed_1_s": 5.0, "temperature_K": 310.0})
    assert read_dataset(kelvin, tank).outputs[0, 0] == 310.0
    with pytest.raises(RangeError, match=r"in degC that would be 310: add 273.15 to the column"):
        read_dataset(kelvin.assign(temperature_K=310.0 - 273.15), tank)
    with pytest.raises(
        RangeError, match=r"in degF that would be 333.15: multiply the column by 0.555556 and add 255.372"
    ):
        read_dataset(kelvin.assign(temperature_K=140.0), tank)


def test_where_several_units_would_fit_all_are_named(model: Model) -> None:
    """1.67e-4 m3/s is 0.167 L/s, 10 L/min and 0.6 m3/h: the number alone does not say which it was."""
    wide = replace(model.inputs[1], usual=(1e-7, 1.0))
    with pytest.raises(RangeError) as caught:
        check_unit(wide, np.full(9, 50.0), "file.csv")
    said = str(caught.value)
    assert all(f"in {unit} that would be" in said for unit in ("L/min", "m3/h", "L/s")) and "3 units would fit" in said


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [("concentrate_grade", 0.01, "1/100"), ("concentrate_flow_m3_s", 1e-3, "1/1000"), ("recovery", 0.01, "1/100")],
)
def test_an_output_that_is_far_too_small_gets_a_word(model: Model, column: str, factor: float, said: str) -> None:
    """A grade of 0.002 is possible, so it is no error: of all that the cell could be it is an unlikely one."""
    read = read_dataset(record(**{column: factor}), model)
    (words,) = off_by_a_unit(model, read.inputs, read.outputs)
    assert column.startswith(words.split(":")[0]) and f"about {said} of the" in words


@pytest.mark.parametrize("factor", [1.0, 0.3, 3.0])
def test_a_plant_that_is_merely_unlike_its_model_gets_none(model: Model, factor: float) -> None:
    read = read_dataset(record(concentrate_grade=factor, concentrate_flow_m3_s=factor), model)
    assert off_by_a_unit(model, read.inputs, read.outputs) == ()
