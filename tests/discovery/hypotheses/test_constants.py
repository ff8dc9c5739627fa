"""Protects: what a reference says of a ratio of constants holds at every size of them.

A heated tank in whose balance power, loss and heat content stand together: no record tells more than their ratios.
Known as plain numbers, with a covariance, all of them could be made small, and the ratio of two was then free. A heater
with less power was told as unchanged, or as a thermometer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.procedure import compare
from adaptive_flot.greybox import Dataset, Effect, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator

MEAN = np.array([200.0, 3.0, -0.5])
ROOT = np.array([[300.0, 0.0, 0.0], [4.4, 0.1, 0.0], [0.2, 0.0, 0.3]])
KNOWN = Constants(("power", "loss", "offset"), MEAN, ROOT, frozenset({"power", "loss"}))
numbers = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(np.array)


@given(numbers)
def test_distances_are_what_the_constants_were_made_of(u: FloatArray) -> None:
    np.testing.assert_allclose(KNOWN.distances(KNOWN.at(u)), ROOT @ u, rtol=1e-9, atol=1e-9)


@given(numbers)
def test_slopes_are_those_of_the_distances(u: FloatArray) -> None:
    x = KNOWN.at(u)
    h = 1e-6 * np.abs(x)
    differences = (KNOWN.distances(x + h) - KNOWN.distances(x - h)) / (2 * h)
    np.testing.assert_allclose(KNOWN.slopes(x), differences, rtol=1e-5)


def test_near_the_mean_both_forms_are_one() -> None:
    plain = replace(KNOWN, ratios=frozenset())
    u = np.array([1e-6, -2e-6, 3e-6])
    np.testing.assert_allclose(KNOWN.at(u), plain.at(u), rtol=1e-9)
    assert (plain.slopes(MEAN) == 1.0).all()


@given(numbers)
def test_a_ratio_is_as_certain_at_every_size(u: FloatArray) -> None:
    """Both constants ten times smaller: what the same numbers make of the ratio stays."""
    moved = KNOWN.about(np.array([20.0, 0.3, -0.5]))
    np.testing.assert_allclose(moved.at(u)[0] / moved.at(u)[1], KNOWN.at(u)[0] / KNOWN.at(u)[1], rtol=1e-9)
    np.testing.assert_allclose(moved.at(u)[2], KNOWN.at(u)[2])


def test_what_is_known_by_ratio_stays_so_where_a_fit_ended_at_zero() -> None:
    at_bound = KNOWN.about(np.array([0.0, 3.0, 0.0]))
    assert (at_bound.mean[:2] > 0).all() and at_bound.mean[2] == 0.0
    assert np.isfinite(np.linalg.inv(at_bound.root)).all()


def test_nothing_is_infinite_at_zero_and_far_away() -> None:
    assert np.isfinite(KNOWN.distances(np.array([0.0, -1.0, 0.0]))).all()
    assert np.isfinite(KNOWN.slopes(np.array([0.0, -1.0, 0.0]))).all()
    assert np.isfinite(KNOWN.at(np.array([1e6, 0.0, 0.0]))).all()


DT, ROWS, NOISE = 20.0, 400, 0.1


def tank() -> Model:
    """A tank of which records tell two ratios of three constants."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heater", m.parameter("power") * m.input("duty"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (temperature - m.input("room")), "flow", unit="W")
        m.derivative("temperature", (heating - loss) / m.parameter("store"))
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))

    def guess(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 20, upper=20 * value, scale=value / 3, role="estimated")

    return Model(
        name="tank",
        states=(Quantity("temperature", "degC", "", -50.0, 300.0, scale=10.0),),
        inputs=(Quantity("duty", "-", "", 0.0, 1.0), Quantity("room", "degC", "", -30.0, 60.0)),
        parameters=(guess("power", 300.0, "W"), guess("conductance", 4.0, "W/K"), guess("store", 2000.0, "J/K")),
        outputs=(Quantity("temperature", "degC", "", scale=10.0),),
        equations=equations,
        max_step_s=DT,
        initial_guess={"temperature": 40.0},
        starts_steady=False,
    )


def record(seed: int, *effects: Effect) -> Dataset:
    """A record of a tank whose constants are not those of the model, with effects that the model does not have."""
    rng = np.random.default_rng(seed)
    duty = np.repeat(rng.uniform(0.1, 0.9, ROWS // 40), 40)
    room = 20.0 + 3.0 * np.sin(np.arange(ROWS) / 60.0)
    plant = tank().with_parameters({"power": 240.0, "conductance": 3.0, "store": 2500.0}).with_effects(effects)
    inputs = np.column_stack([duty, room])
    data = Dataset("record", DT * np.arange(ROWS, dtype=np.float64), DT, inputs, np.zeros((ROWS, 1)))
    x0 = np.concatenate([[50.0], np.ones(len(plant.states) - 1)])
    true = RecordSimulator(plant, DT).outputs(data, x0, plant.parameter_values)
    return replace(data, outputs=true + NOISE * rng.normal(size=(ROWS, 1)))


AGED = Effect("heater", "constant", "shift", {"amplitude": -0.15}, mode="factor")


@pytest.mark.parametrize("seed", range(3))
def test_a_heater_that_has_aged_is_told_and_no_thermometer(seed: int) -> None:
    """With seed 0 the fits of plain numbers had run to the bounds of the constants, and the thermometer was told."""
    compared = compare(tank(), [record(10 + seed, AGED)], [record(seed)])
    assert compared.calibration.constants.ratios == {"power", "conductance", "store"}
    assert compared.verdict.word == "named", compared.verdict.reason
    assert [t.hypothesis and t.hypothesis.label for t in compared.judged.parts] == ["heater gain"]
    assert compared.tested[0].fit.values["heater_by_constant.amplitude"] == pytest.approx(-0.15, abs=0.01)


@pytest.mark.parametrize("level", [60.0, 110.0])
def test_a_heater_that_does_not_close_is_fitted_though_all_constants_move(level: float) -> None:
    """Its level and all constants go together. With derivatives from before, the fit ended 26 times above the noise."""
    leaks = Effect("heater", "own_value", "leak", {"amplitude": 1.0, "level": level}, {"width": 1.0})
    compared = compare(tank(), [record(10, leaks)], [record(0)])
    best = compared.tested[0]
    assert best.hypothesis is not None and best.hypothesis.label == "heater leaks"
    told = best.fit.value("heater_by_own_value.level") / best.fit.value("power")
    assert told == pytest.approx(level / 240.0, rel=0.02)
    assert compared.verdict.error[0].after < 1.2 * NOISE


@pytest.mark.parametrize("seed", range(3))
def test_fits_do_not_drift_where_nothing_is_told(seed: int) -> None:
    """Constants of every fit stay within a factor of eight of those of the reference; their bounds are at about 20."""
    compared = compare(tank(), [record(10 + seed, AGED)], [record(seed)])
    before = compared.calibration.fit.values
    for fit in (compared.null.fit, *(t.fit for t in compared.tested)):
        for name in compared.calibration.constants.names:
            assert 1 / 8 < fit.value(name) / before[name] < 8, (name, fit.value(name), before[name])


@pytest.mark.parametrize("seed", range(3))
def test_nothing_new_is_nothing(seed: int) -> None:
    assert compare(tank(), [record(10 + seed)], [record(seed)]).verdict.word == "none"
