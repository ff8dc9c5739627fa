"""Records and models of a user's own that are not like the laboratory's.

Rare assays, coarse sensors, signals that are off most of the time, first guesses far away: each with a known truth, or
the same record without its oddity beside it.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.record.noise import MOST_LAGS, Noise, is_dense
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from tests.discovery.heated import CAPACITY, DT, NOISE, ROOM, Truth, equations, heated_tank, moves, tank_record

ROWS = 1200
DRAUGHT = ("heat_loss", "fan_speed")


def _names(verdict: Verdict) -> list[tuple[str, str]]:
    return [(e.effect.site, e.effect.driver) for e in verdict.effects]


def _changed(record: Dataset, outputs: FloatArray) -> Dataset:
    return replace(record, outputs=outputs)


def _assayed_tank() -> Model:
    """The tank with a second output, whose law lacks that it depends on the fan."""

    def both(m: Scope) -> None:
        equations(m)
        m.output("grade", m.site("grade_law", m.parameter("yield") * m.input("power") / 1000.0))

    tank = heated_tank()
    gain = Parameter("yield", 1.0, "-", "first guess", None, 0.1, 10.0, 1.0, role="estimated")
    outputs = (*tank.outputs, Quantity("grade", "-", ""))
    return replace(tank, name="assayed", equations=both, outputs=outputs, parameters=(*tank.parameters, gain))


def _assayed_record() -> Dataset:
    record = tank_record(Truth(exponent=0.0), rows=ROWS)
    power, fan = record.inputs.T
    grade = power / 1000 * (fan / 10) ** 0.1 + 0.002 * np.random.default_rng(9).standard_normal(ROWS)
    return _changed(record, np.column_stack([record.outputs[:, 0], grade]))


def test_an_effect_that_shows_in_a_rare_assay_is_named() -> None:
    record = _assayed_record()
    record.outputs[np.arange(ROWS) % 4 > 0, 1] = np.nan
    found = discover(_assayed_tank(), record).verdict
    assert found.word == "named" and _names(found) == [("grade_law", "fan_speed")]


def test_a_record_with_nothing_but_a_rare_assay_is_judged() -> None:
    record = tank_record(rows=ROWS)
    record.outputs[np.arange(ROWS) % 3 > 0] = np.nan
    assert _names(discover(heated_tank(), record).verdict) == [DRAUGHT]


def test_an_output_that_was_measured_in_the_end_only_is_left_out_and_said_so() -> None:
    record = tank_record(rows=ROWS)
    late = np.full(ROWS, np.nan)
    late[-50:] = _assayed_record().outputs[-50:, 1]
    found = discover(_assayed_tank(), _changed(record, np.column_stack([record.outputs[:, 0], late]))).verdict
    assert _names(found) == [DRAUGHT] and np.isfinite(found.error[0].after)
    assert any(n.startswith("grade: too few values") for n in found.notes)


def test_outputs_of_which_none_is_measured_throughout_are_insufficient() -> None:
    record = tank_record(rows=2 * ROWS)
    record.outputs[:-210] = np.nan
    found = discover(heated_tank(), record).verdict
    assert found.word == "insufficient" and "throughout" in found.reason


def test_the_first_row_of_a_table_with_states_is_a_start_and_no_truth() -> None:
    """A spike in it would else go into every run, while the same record without the column has it fitted."""
    record = tank_record()
    record.outputs[0] += 3.0
    plain, given = (
        discover(heated_tank(), replace(record, initial_state=x0)).verdict for x0 in (None, record.outputs[0].copy())
    )
    assert plain.word == given.word == "named"
    np.testing.assert_allclose([given.error[0].before, given.error[0].after],
                               [plain.error[0].before, plain.error[0].after], rtol=0.02)  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_a_coarse_sensor_does_not_replace_the_answer(seed: int) -> None:
    """A resolution of 0.2 K, four times the noise: most differences are zero, and the noise is not."""
    record = tank_record(Truth(exponent=0.0, loss_step=0.2), seed=seed)
    found = discover(heated_tank(), _changed(record, np.round(record.outputs / 0.2) * 0.2)).verdict
    assert ("heat_loss", "time") in _names(found)
    assert found.error[0].after < 0.12  # the resolution alone is 0.2 / sqrt(12) = 0.058, the noise 0.05


def test_a_record_shorter_than_the_longest_dead_time_is_judged() -> None:
    record = tank_record(rows=230)
    found = discover(heated_tank(), replace(record, time=np.arange(1.0, 231.0), dt=1.0))
    assert found.verdict.word


def _fast(loss: float, role: str = "estimated") -> Model:
    """A tank that has come to rest within every row: nothing is left of its initial state."""

    def at_rest(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator")
        lost = m.site("heat_loss", m.parameter("loss") * (temperature - ROOM))
        m.derivative("temperature", (heating - lost) / (CAPACITY / 1000))
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset"))

    tank = heated_tank()
    efficiency, own = tank.parameters
    parameters = (replace(efficiency, role=role), replace(own, value=loss, role=role))  # type: ignore[arg-type]
    return replace(tank, equations=at_rest, parameters=parameters, max_step_s=1.0)


@pytest.mark.parametrize("guess", [60.0, 80.0, 150.0])
def test_a_first_guess_far_off_makes_no_difference(guess: float) -> None:
    inputs = np.column_stack([moves(600, 500, 3000, 40, 100), moves(600, 5, 20, 25, 200)])
    y = ROOM + 0.9 * inputs[:, :1] / 60.0 + NOISE * np.random.default_rng(0).standard_normal((600, 1))
    found = discover(_fast(guess), Dataset("fast", DT * np.arange(1.0, 601.0), DT, inputs, y)).verdict
    assert found.word == "none" and found.error[0].after < 1.3 * NOISE


def test_a_model_that_knows_all_its_parameters_is_searched() -> None:
    tank = heated_tank()
    known = tuple(replace(p, role="fixed", value=60.0 if p.name == "loss" else p.value) for p in tank.parameters)
    assert _names(discover(replace(tank, parameters=known), tank_record()).verdict) == [DRAUGHT]


@pytest.mark.parametrize("guess", [-4.5, -2.0])
def test_parameters_may_be_negative_and_signals_may_come_after_a_site(guess: float) -> None:
    """ln(loss / 1000) is -2.8; the surplus is known only where the loss has been given."""

    def logarithmic(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator")
        lost = m.site("heat_loss", 1000 * ca.exp(m.parameter("log_loss")) * (temperature - ROOM))
        surplus = m.signal("surplus", 2.0e4 + heating - lost)
        m.derivative("temperature", (surplus - 2.0e4) / CAPACITY)
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset"))

    tank = heated_tank()
    model = replace(
        tank,
        equations=logarithmic,
        signals=(Quantity("surplus", "W", "heating less loss, from -20 kW on"),),
        drivers=("power", "fan_speed", "surplus"),
        parameters=(
            tank.parameters[0],
            Parameter("log_loss", guess, "-", "first guess", None, -5.0, 0.0, 0.5, role="estimated"),
        ),
    )
    assert next(s for s in model.sites if s.name == "heat_loss").signals == ()
    assert next(s for s in model.sites if s.name == "thermometer").signals == ("surplus",)
    assert _names(discover(model, tank_record()).verdict) == [DRAUGHT]


def test_a_dependence_on_a_signal_that_is_off_most_of_the_time_is_named() -> None:
    rng = np.random.default_rng(5)
    fan, power = np.repeat((rng.random(24) < 0.33) * 15.0, 25), moves(600, 500, 3000, 40, 100)
    at_ten = tank_record(Truth(exponent=0.0), inputs=np.column_stack([power, fan]))
    assert discover(heated_tank(), at_ten).verdict.word == "none"
    temperature, seen = 305.0, []
    for watt, speed in zip(power, fan, strict=True):
        for _ in range(10):
            lost = 60.0 * (1.6 if speed else 1.0) * (temperature - ROOM)
            temperature += DT / 10 * (0.9 * watt - lost) / CAPACITY
        seen.append(temperature)
    found = discover(heated_tank(), _changed(at_ten, np.array(seen)[:, None] + NOISE * rng.standard_normal((600, 1))))
    assert found.verdict.word == "named" and _names(found.verdict) == [DRAUGHT]


def test_noise_by_differences_of_dense_rare_and_coarse_series() -> None:
    rng = np.random.default_rng(0)
    white = rng.standard_normal(6000)
    rare, spiked = white.copy(), white.copy()
    rare[np.arange(6000) % 5 > 0] = np.nan
    spiked[::50] += 100.0
    coarse = np.round(white / 3) * 3  # within 1.5 standard deviations all is zero: seven values of eight
    found = noise_by_differences(np.column_stack([white, rare, spiked, coarse, np.full(6000, np.nan)]))
    np.testing.assert_allclose(found[:3], 1.0, atol=0.06)
    np.testing.assert_allclose(found[3], np.std(coarse), rtol=0.03)
    assert np.isnan(found[4])


def test_a_missing_value_takes_with_it_what_looks_back_to_it_unless_values_are_rare() -> None:
    noise = Noise(np.ones(2), np.zeros((2, MOST_LAGS)))
    series = np.ones((1000, 2))
    series[500, 0] = np.nan
    series[np.arange(1000) % 3 > 0, 1] = np.nan
    white = noise.whiten(series)
    assert is_dense(series[:, 0]) and not is_dense(series[:, 1])
    assert np.flatnonzero(np.isnan(white[:, 0])).tolist() == [500, 501, 502, 503]
    assert np.isfinite(white[:, 1]).sum() == 334
