"""Units of plants: each spelling comes to the SI value that a table of units gives."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.records.units import convert, fits, is_unit, read_unit, seconds


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        ("L/min", "m3/s", 1e-3 / 60),
        ("lpm", "m3/s", 1e-3 / 60),
        ("m³/h", "m3/s", 1 / 3600),
        ("m3/hr", "m3/s", 1 / 3600),
        ("m^3/h", "m3/s", 1 / 3600),
        ("gpm", "m3/s", 3.785411784e-3 / 60),
        ("cfm", "m3/s", 0.3048**3 / 60),
        ("%", "-", 0.01),
        ("pct", "-", 0.01),
        ("wt%", "-", 0.01),
        ("g/t", "-", 1e-6),
        ("mm", "m", 1e-3),
        ("t/h", "kg/s", 1000 / 3600),
        ("kPa", "Pa", 1e3),
        ("rpm", "1/s", 1 / 60),
    ],
)
def test_a_unit_has_the_factor_of_its_definition(unit: str, wanted: str, factor: float) -> None:
    assert convert(np.array([1.0, -2.0]), unit, wanted) == pytest.approx([factor, -2 * factor], rel=1e-12)


def test_temperatures_have_an_offset() -> None:
    assert convert(np.array([25.0]), "°C", "K") == pytest.approx([298.15])


def test_the_same_unit_changes_no_bit() -> None:
    values = np.array([0.1, 1 / 3])
    assert np.array_equal(convert(values, "m3/s", "m³/s"), values)


@pytest.mark.parametrize("text", ["L/mn3", "FIC_101.PV", "Timestamp", "Nm3/h", "scfm", "Nl/min"])
def test_what_is_no_unit_of_a_volume_in_the_cell_is_refused(text: str) -> None:
    assert not is_unit(text)
    with pytest.raises(DataError, match="unit"):
        read_unit(text)


def test_a_unit_of_something_else_is_refused() -> None:
    assert not fits("mm", "m3/s")
    with pytest.raises(DataError, match="'mm' can not be converted to 'm3/s'"):
        convert(np.array([1.0]), "mm", "m3/s")


@pytest.mark.parametrize(("text", "value"), [("90 s", 90.0), ("1.5min", 90.0), ("2 h", 7200.0), ("250 ms", 0.25)])
def test_durations(text: str, value: float) -> None:
    assert seconds(text) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["90", "s", "-1 s", "1 L", "nan s"])
def test_what_is_no_duration_is_refused(text: str) -> None:
    with pytest.raises(DataError, match="no duration; write one as 10 s"):
        seconds(text)
