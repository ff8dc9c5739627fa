"""Two columns with each other's values are refused where both can not be; where one may be, that is said."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import DataError, RangeError
from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.data.dataset import read_dataset

ROWS = 50


def equations(m: Scope) -> None:
    moisture, warmth = m.state("moisture"), m.state("warmth")
    m.derivative("moisture", m.input("vapour") - m.parameter("airing") * moisture)
    m.derivative("warmth", m.input("power") - m.parameter("airing") * warmth)
    m.output("moisture", moisture)
    m.output("warmth", warmth)


def room(warmest: float, coldest: float = 0.0, moist_to: float = 1.0) -> Model:
    """A room with two inputs and two outputs, whose ranges overlap or do not."""
    moisture = Quantity("moisture", "g/m3", "of the air", 0.0, moist_to)
    warmth = Quantity("warmth", "degC", "of the room", coldest, warmest)
    vapour = Quantity("vapour", "g/m3/s", "into it", 0.0, 0.1)
    power = Quantity("power", "degC/s", "of the heater", 0.0, 5.0)
    known = Parameter("airing", 0.1, "1/s", "a guess", lower=0.0, upper=1.0)
    return Model(
        name="room",
        states=(moisture, warmth),
        inputs=(vapour, power),
        parameters=(known,),
        outputs=(moisture, warmth),
        equations=equations,
        max_step_s=10.0,
    )


def record(**columns: float) -> pd.DataFrame:
    sound = {"vapour_g_m3_s": 0.05, "power_degC_s": 3.0, "moisture_g_m3": 0.5, "warmth_degC": 40.0}
    constant = {name: np.full(ROWS, columns.get(name, value)) for name, value in sound.items()}
    return pd.DataFrame({"time_s": 10.0 * np.arange(ROWS), **constant})


def test_a_sound_record_and_a_gauge_that_is_off_pass_without_a_word() -> None:
    model = room(90.0, 5.0)
    assert read_dataset(record(), model).notes == ()
    assert read_dataset(record(moisture_g_m3=1.4), model).notes == ()


def test_outputs_that_are_both_impossible_are_refused() -> None:
    with pytest.raises(RangeError, match="'moisture_g_m3' and 'warmth_degC' seem to be swapped") as caught:
        read_dataset(record(moisture_g_m3=40.0, warmth_degC=0.5), room(90.0, 5.0))
    assert "their medians are 40 g/m3 and 0.5 degC, both are outside their ranges; give each its own name" in str(
        caught.value
    )


def test_where_one_of_two_outputs_is_possible_it_is_said() -> None:
    notes = read_dataset(record(moisture_g_m3=40.0, warmth_degC=0.5), room(90.0)).notes
    assert notes == (
        "columns 'moisture_g_m3' and 'warmth_degC' may be swapped: their medians are 40 g/m3 and 0.5 degC, "
        "the first is outside [0, 1]",
    )


def test_an_output_without_a_range_can_not_tell() -> None:
    assert read_dataset(record(moisture_g_m3=40.0, warmth_degC=0.5), room(np.inf)).notes == ()


def test_of_inputs_one_that_is_impossible_is_refused_with_the_other() -> None:
    with pytest.raises(RangeError, match="'vapour_g_m3_s' and 'power_degC_s' may be swapped"):
        read_dataset(record(vapour_g_m3_s=3.0, power_degC_s=0.05), room(90.0))


@pytest.mark.parametrize(("sign", "said"), [(";", "a semicolon"), ("\t", "a tab"), ("|", "a bar")])
def test_another_separator_is_told_by_its_name(tmp_path_of: Callable[[str], str], sign: str, said: str) -> None:
    text = record().to_csv(index=False, sep=sign, decimal=",")
    with pytest.raises(DataError, match=f"its columns are separated by {said}, and not by a comma"):
        read_dataset(tmp_path_of(text), room(90.0))


def test_an_output_whose_column_is_empty_is_said_to_be_not_measured() -> None:
    empty = record().assign(warmth_degC=np.nan)
    assert read_dataset(empty, room(90.0)).notes == ("warmth is not measured: column 'warmth_degC' is empty",)


def test_a_row_that_is_too_long_is_told_by_its_line(tmp_path_of: Callable[[str], str]) -> None:
    lines = record().to_csv(index=False).splitlines()
    lines[20] += ",1,2"
    with pytest.raises(DataError, match="line 21 has 7 values, where 5 are expected"):
        read_dataset(tmp_path_of("\n".join(lines)), room(90.0))


@pytest.fixture
def tmp_path_of(tmp_path: object) -> Callable[[str], str]:
    """Write a text to a file, and give its path."""

    def write(text: str) -> str:
        path = f"{tmp_path}/record.csv"
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    return write
