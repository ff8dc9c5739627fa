"""A line with kinks over a signal: found in a curve that draws one, and told on a tank whose fan has a threshold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.catalogue import Candidate
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.shapes.limited_lines import LIMITED, limited_lines
from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import CAPACITY, DT, NOISE, ROOM, heated_tank, moves

FAN = ("heat_loss", "fan_speed")
LOW, HIGH, KNOTS = 5.0, 20.0, 16


def curve_of(factor: np.ndarray, knots: np.ndarray) -> tuple[Score, Effect]:
    """A fitted curve of the loss over the fan, as the search has it: the logarithm of a factor."""
    site = next(s for s in heated_tank().sites if s.name == "heat_loss")
    coefficients = {f"value_{k + 1}": float(v) for k, v in enumerate(np.log(factor))}
    curve = Effect(*FAN, "curve", coefficients, settings={"knots": tuple(knots.tolist())})
    return Score(Candidate(site, "fan_speed", True, ()), None, 1.0, 1.0, {}), curve  # type: ignore[arg-type]


@settings(deadline=None, max_examples=40)
@given(st.floats(7.0, 12.0), st.floats(2.0, 6.0), st.floats(0.3, 2.0))
def test_the_kinks_of_a_line_are_found_to_within_their_grid(begins: float, lasts: float, rise: float) -> None:
    knots = np.linspace(LOW, HIGH, KNOTS)
    shape = np.clip((knots - begins) / lasts, 0, 1)
    score, curve = curve_of(1 + rise * shape, knots)
    both = limited_lines(score, curve, np.linspace(LOW, HIGH, 500))[-1]
    assert both.variant.effect.form == LIMITED["factor"] and both.variant.effect.settings["sides"] == 3.0
    grid = (HIGH - LOW) / 20
    assert both.start["begins"] == pytest.approx(begins, abs=2 * grid)
    assert both.start["ends"] == pytest.approx(begins + lasts, abs=2 * grid)
    first, last = both.start["amplitude"] - both.start["slope"] / 2, both.start["amplitude"] + both.start["slope"] / 2
    assert last > first


def test_what_is_no_line_is_not_tried() -> None:
    """A hump: no line with level ends draws it."""
    knots = np.linspace(LOW, HIGH, KNOTS)
    score, curve = curve_of(1 + np.exp(-(((knots - 12.5) / 2) ** 2)), knots)
    assert limited_lines(score, curve, np.linspace(LOW, HIGH, 500)) == []


def test_a_signal_at_rest_has_no_line() -> None:
    score, curve = curve_of(np.linspace(1, 2, KNOTS), np.linspace(LOW, HIGH, KNOTS))
    assert limited_lines(score, curve, np.full(100, 7.0)) == []


@settings(deadline=None, max_examples=30)
@given(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 30.0))
def test_the_factor_is_straight_between_its_kinks_and_level_beyond(amplitude: float, slope: float, fan: float) -> None:
    values = {"amplitude": amplitude, "slope": slope, "begins": 8.0, "ends": 14.0}
    effect = Effect(*FAN, "limited_factor", values, {"knots": (LOW, HIGH)})
    tank = heated_tank().with_effects([effect])
    rate = float(np.array(tank.ode(0.0, [310.0], [1500.0, fan], tank.parameter_values)[0]).ravel()[0])
    loss = 0.9 * 1500.0 - CAPACITY * rate
    low, high = np.exp(amplitude - slope / 2), np.exp(amplitude + slope / 2)
    share = (min(max(fan, 8.0), 14.0) - 8.0) / 6.0
    assert loss == pytest.approx(80.0 * (310.0 - ROOM) * ((1 - share) * low + share * high), rel=1e-9)


def test_a_threshold_of_the_fan_is_told_at_its_site() -> None:
    """Up to 12 turns a second the vent stays shut; above, the loss rises in proportion."""
    rows = 700
    inputs = np.column_stack([moves(rows, 500, 3000, 40, 100), moves(rows, 5, 20, 25, 200)])
    temperature, seen = 305.0, []
    for power, fan in inputs:
        loss = 60.0 * (1 + 0.25 * max(fan - 12.0, 0.0))
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - ROOM)) / CAPACITY
        seen.append(temperature)
    y = np.array(seen) + NOISE * np.random.default_rng(0).standard_normal(rows)
    record = Dataset("tank", DT * np.arange(1.0, rows + 1), DT, inputs, y[:, None])
    verdict = discover(heated_tank(), record).verdict
    assert verdict.word == "named" and [(e.effect.site, e.effect.driver) for e in verdict.effects] == [FAN]
    effect = verdict.effects[0].effect
    assert effect.form == "limited_factor"
    assert effect.coefficients["begins"] == pytest.approx(12.0, abs=0.3)
