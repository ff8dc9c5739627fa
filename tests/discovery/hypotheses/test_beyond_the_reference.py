"""Where a plant is beyond its reference, an `abstain` says so: by its inputs, and by its outputs in the model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.hypotheses.judgement import USUAL, Judged
from adaptive_flot.discovery.hypotheses.telling import _beyond, _reason
from adaptive_flot.discovery.results import OutputChange
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.heated import heated_tank

ROWS = 400


def _rows(temperature: FloatArray, fan: FloatArray) -> Rows:
    inputs = np.column_stack([np.full(ROWS, 1000.0), fan])
    data = Dataset("record", np.arange(1.0, ROWS + 1), 1.0, inputs, temperature[:, None])
    return Rows((data,), (0,), (np.ones((ROWS, 1)),), (np.ones(ROWS, dtype=bool),))


def _said(temperature: FloatArray, fan: FloatArray, errors: FloatArray | float = 0.0) -> str:
    usual = _rows(np.linspace(300.0, 320.0, ROWS), np.linspace(5.0, 20.0, ROWS))
    calibration = SimpleNamespace(model=heated_tank(), rows=usual)
    null = SimpleNamespace(fresh=(np.broadcast_to(errors, (ROWS, 1)),))
    return "".join(_beyond(calibration, _rows(temperature, fan), null))  # type: ignore[arg-type]


def test_nothing_is_said_inside() -> None:
    assert not _said(np.linspace(301.0, 320.5, ROWS), np.linspace(5.0, 20.0, ROWS))


@pytest.mark.parametrize(
    ("temperature", "fan", "said"),
    [
        (np.linspace(310.0, 330.0, ROWS), np.full(ROWS, 9.0), "temperature is higher in 4"),
        (np.full(ROWS, 310.0), np.linspace(1.0, 19.0, ROWS), "fan speed is lower in 1"),
    ],
)
def test_what_is_beyond_is_told_with_its_share(temperature: FloatArray, fan: FloatArray, said: str) -> None:
    assert said in _said(temperature, fan)


def test_a_gauge_that_is_off_brings_no_plant_anywhere() -> None:
    assert not _said(np.linspace(310.0, 330.0, ROWS), np.full(ROWS, 9.0), np.linspace(0.0, 15.0, ROWS)[:, None])


def test_a_free_run_that_leaves_the_plant_brings_no_plant_anywhere() -> None:
    """What was measured is where the reference was, and the model is 15 K above it."""
    errors = -np.linspace(0.0, 15.0, ROWS)[:, None]
    assert not _said(np.linspace(302.0, 319.0, ROWS), np.full(ROWS, 9.0), errors)
    assert "temperature is higher" in _said(np.linspace(312.0, 339.0, ROWS), np.full(ROWS, 9.0), errors)


@pytest.mark.parametrize(
    ("larger", "said"), [(1.1, USUAL), (2.0, "its errors are up to 2 times those of the reference")]
)
def test_none_does_not_call_errors_the_same_that_are_twice_as_large(larger: float, said: str) -> None:
    """Measured: a healthy web winder at a higher speed, whose reference has stretches as bad."""
    error = OutputChange("temperature", "K", larger, larger, 1.0, (0.0, 0.0))
    judged = Judged("none", None, (), USUAL, float("nan"))
    assert said in _reason(heated_tank(), judged, True, [error])
