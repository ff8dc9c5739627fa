"""A sensor that is read at even intervals is found by when it changes, against one that is read in plain Python."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.shapes.readings import HELD, SHORTEST, readings
from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from tests.discovery.heated import DT, NOISE, Truth, changed, heated_tank, moves, tank_record

ROWS = 600


def kept(values: FloatArray, interval: float, first: float) -> FloatArray:
    """What a sensor shows that reads `values` (N,) at `first` and every `interval` from there, in rows."""
    shown, at = [], first - interval
    for k in range(len(values)):
        while at + interval <= k:
            at += interval
        shown.append(float(np.interp(at, np.arange(len(values)), values)))
    return np.array(shown)


def wander(seed: int, rows: int = ROWS) -> FloatArray:
    """A smooth random course (N,)."""
    noise = np.random.default_rng(seed).normal(size=rows + 20).cumsum()
    smooth: FloatArray = np.convolve(noise, np.ones(20) / 20, "valid")[:rows]
    return smooth


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.floats(SHORTEST + 1, 60.0), st.floats(0.0, 1.0))
def test_interval_and_first_reading_are_found(seed: int, interval: float, phase: float) -> None:
    """To a fraction of a row over the whole record, with noise of a tenth of the error."""
    value = wander(seed)
    shown = kept(value, interval, phase * interval)
    noise = 0.1 * float(np.std(shown - value)) * np.random.default_rng(seed + 1).normal(size=ROWS)
    found = readings(value, shown + noise, np.ones(ROWS))
    assert found is not None
    again = kept(value, found[0], found[1] % found[0])
    assert float(np.std(again - shown)) < 0.35 * float(np.std(shown - value))


def test_rows_without_weight_do_not_count() -> None:
    value = wander(3)
    shown, weights = kept(value, 23.4, 5.0), np.ones(ROWS)
    shown[200:300], weights[200:300] = 1e3, 0.0
    found = readings(value, shown, weights)
    assert found is not None and found[0] == pytest.approx(23.4, abs=0.05)


def test_a_record_of_a_few_rows_has_none() -> None:
    assert readings(np.arange(20.0), np.arange(20.0), np.ones(20)) is None


@pytest.mark.parametrize("rows", [6.0, 17.3])
def test_the_form_shows_what_was_read_last(rows: float) -> None:
    """Against plain Python: all but what a reading takes, which is about a row."""
    record = tank_record(Truth(exponent=0.0, noise=0.0))
    periods = float(int((ROWS - 3) / rows))
    times = {"first_reading": 3 * DT, "last_reading": 3 * DT + periods * rows * DT}
    settings = {"scale": 300.0, "periods": periods, "interval_s": DT}
    effect = Effect("thermometer", "delay", HELD, {"amplitude": 1.0, **times}, settings)
    model = heated_tank().with_effects([effect])
    run = Stepper(model, DT).simulate(np.array([305.0, 305.0 / 300.0]), record.inputs[1:], model.parameter_values, DT)
    shown, true = run.outputs[:, 0], run.states[:, 0]
    expected = kept(true, rows, 1.0)
    assert float(np.std((shown - expected)[20:])) < 0.5 * float(np.std((true - expected)[20:]))
    nothing = replace(effect, coefficients={"amplitude": 0.0, **times})
    plain = heated_tank().with_effects([nothing])
    same = Stepper(plain, DT).simulate(np.array([305.0, 305.0 / 300.0]), record.inputs[1:], plain.parameter_values, DT)
    np.testing.assert_allclose(same.outputs[:, 0], same.states[:, 0], rtol=0, atol=1e-12)


def test_a_thermometer_that_is_read_every_few_minutes_is_told_so() -> None:
    """Every 11.5 rows of 30 s; the verdict gives the interval, and no dead time."""
    inputs = np.column_stack([moves(ROWS, 500, 3000, 40, 7), moves(ROWS, 5, 20, 25, 8)])
    record = tank_record(Truth(exponent=0.0, noise=0.0), inputs=inputs)
    noise = NOISE * np.random.default_rng(5).normal(size=ROWS)
    shown = kept(record.outputs[:, 0], 11.5, 4.0) + noise
    verdict = discover(heated_tank(), changed(record, shown)).verdict
    assert verdict.word == "named", verdict.reason
    assert [(e.effect.site, e.effect.driver, e.effect.form) for e in verdict.effects] == [
        ("thermometer", "delay", HELD)
    ]
    assert verdict.reason.startswith("Thermometer is read every 34") and " s, and kept in between" in verdict.reason
