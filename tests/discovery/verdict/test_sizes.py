"""Protects: the first sentence of a verdict says what is the matter, by how much, in which direction and when."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.results import Discovery, NamedEffect
from adaptive_flot.discovery.verdict.words.curve import EffectCurve
from adaptive_flot.discovery.verdict.words.sizes import words_of_effect, words_of_effects
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.discovery.tables import coefficient_table
from tests.discovery.background.test_uncertain_constants import jacketed_tank

MODEL = jacketed_tank()
Settings = Mapping[str, float | tuple[float, ...]]


SETTINGS: Mapping[str, Settings] = {
    "curve": {"knots": (0.0, 1.0)},
    "polyline": {"knots": (0.0, 1.0)},
    "step": {"width": 1.0},
    "lag": {"scale": 1.0},
    "delay": {"scale": 1.0},
    "direction": {"scale": 1.0},
    "cubic": {"knots": (-1.0, 1.0)},
}


def told(site: str, driver: str, form: str, meaning: str = "", half: float = 0.0, **coefficients: float) -> NamedEffect:
    """An effect, each coefficient with an interval of so much on either side where that is not zero."""
    intervals = {k: (v - half, v + half) for k, v in coefficients.items()} if half else {}
    return NamedEffect(Effect(site, driver, form, coefficients, SETTINGS.get(form, {})), meaning, intervals, ())


def curve(effect: NamedEffect, driver: FloatArray, change: FloatArray, unit: str, *, relative: bool) -> EffectCurve:
    return EffectCurve(effect.effect, unit, "-", relative, driver, change, change, change, driver)


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        (
            told("heat_loss", "jacket", "direction", amplitude=0.1, turn=float(np.log(1.1)), width=0.5),
            "heat loss depends on the sign of jacket: 21 % more above zero than below",
        ),
        (
            told("thermometer", "jacket", "direction", amplitude=0.1, turn=-0.25, width=0.5),
            "thermometer depends on the sign of jacket: 0.5 K less above zero than below",
        ),
        (
            told("heat_loss", "constant", "shift", "a draught", 1e-4, amplitude=float(np.log(0.8))),
            "heat loss is 20 % less than the model says (95 %: 19 to 21 %; a draught)",
        ),
        (
            told("heat_loss", "constant", "shift", "a draught", 0.05, amplitude=float(np.log(0.8))),
            "heat loss is 20 % less than the model says (95 %: 15 to 24 %; a draught)",
        ),
        (told("heat_loss", "constant", "shift", amplitude=1.03), "heat loss is 2.8 times as much as the model says"),
        (told("heating", "constant", "shift", amplitude=-0.05), "heating is 4.9 % less than was asked"),
        (told("thermometer", "constant", "shift", amplitude=-1.5), "thermometer shows 1.5 K too little"),
        (
            told("thermometer", "constant", "shift", half=2.0, amplitude=1.5),
            "thermometer shows 1.5 K too much (95 %: -0.5 K to +3.5 K)",
        ),
        (told("heat_loss", "time", "step", amplitude=-0.2231, onset=1500.0), "heat loss fell by 20 % at 1500 s"),
        (
            told("heat_loss", "time", "ramp", amplitude=float(np.log(1.3)), onset=600.0, duration=300.0),
            "heat loss rose by 30 % from 600 s to 900 s",
        ),
        (
            told("thermometer", "time", "washout", amplitude=0.5, onset=600.0, time_constant=100.0),
            "thermometer came to show 0.5 K more from 600 s to 900 s",
        ),
        (
            told("thermometer", "lag", "lag", amplitude=1.0, time_constant=42.0),
            "thermometer answers slowly, with a time constant of 42 s",
        ),
        (
            told("heat_loss", "time", "polyline", value_1=-0.2231, value_2=0.1),
            "heat loss wanders in time, between 20 % less and 11 % more",
        ),
        (told("heating", "delay", "delay", amplitude=1.0, dead_time=30.0), "heating answers 30 s late"),
        (
            told("heating", "time", "stuck_while", amplitude=1.0, level=40.0, on_1=600.0, for_1=300.0),
            "heating stayed at 40 W from 600 s to 900 s, whatever was asked",
        ),
        (
            told("thermometer", "time", "stuck_while", amplitude=1.0, level=21.5, on_1=600.0, for_1=300.0),
            "thermometer showed 21.5 K from 600 s to 900 s",
        ),
    ],
)
def test_an_effect_is_told_with_size_direction_and_time(effect: NamedEffect, said: str) -> None:
    assert words_of_effect(MODEL, effect) == said


@given(st.floats(-2.0, 0.6), st.floats(1e-5, 0.3))
def test_a_share_is_told_within_its_interval(level: float, half: float) -> None:
    """A size of "71 %" stood beside "70.4 to 70.7 %": each right by its own digits, and against each other."""
    if abs(level) <= half:
        return
    said = words_of_effect(MODEL, told("heat_loss", "constant", "shift", half=half, amplitude=level))
    found = re.search(r"is (\S+) % \w+ than the model says \(95 %: (\S+) to (\S+) %\)", said)
    if np.exp(level + half) > 2:
        return  # told in times
    assert found, said
    value, low, high = map(float, found.groups())
    ends = sorted(abs(100 * np.expm1([level - half, level + half])))
    assert low <= min(value, ends[0] + 1e-6) and high >= max(value, ends[1] - 1e-6), said


def test_a_dependence_is_told_between_the_extremes_of_its_curve() -> None:
    speed = np.linspace(0.0, 20.0, 161)
    effect = told("heat_loss", "fan_speed", "curve")
    humped = 1.0 + 0.5 * np.exp(-((speed - 10.0) ** 2))
    said = words_of_effects(MODEL, [effect], [curve(effect, speed, humped, "1/s", relative=True)])
    assert said == "Heat loss depends on fan speed: 50 % more at fan speed 10 1/s than at 0.5 1/s"
    rising = words_of_effect(MODEL, effect, curve(effect, speed, 1.0 + speed / 5.0, "1/s", relative=True))
    assert rising == "heat loss depends on fan speed: 4.5 times as much at fan speed 19.5 1/s as at 0.5 1/s"


def test_a_fall_of_which_the_record_does_not_know_how_long_it_lasts_is_told_as_far_as_it_goes() -> None:
    """A catalyst that decays all the time "fell by 38 % (95 %: -99 % to +3024 %)": its rate alone was known."""
    effect = told("heat_loss", "time", "ramp", amplitude=-0.478, onset=342.0, duration=9565.0)
    unknown = replace(effect, interval95={"amplitude": (-4.4, 3.4), "duration": (2.6, 3.4e7)})
    time = np.linspace(0.0, 10000.0, 161)
    change = np.exp(-0.478 * np.clip((time - 342.0) / 9565.0, 0.0, 1.0))
    said = words_of_effect(MODEL, unknown, curve(effect, time, change, "s", relative=True))
    assert said == "heat loss fell by 38 % from 342 s to the end of the record"
    known = replace(effect, interval95={"amplitude": (-0.5, -0.45), "duration": (9540.0, 9590.0)})
    over = words_of_effect(MODEL, known, curve(effect, time, change, "s", relative=True))
    assert over == "heat loss fell by 38 % from 342 s to 9907 s (95 %: 36 to 40 %)"


@pytest.mark.parametrize(
    ("onset", "duration", "when"),
    [
        (1036888.0, 1.0, "at 1036888 s"),  # rows of 900 s: no ramp of a second
        (1036888.0, 4000.0, "from 1036888 s to 1040888 s"),
        (12.5, 0.05, "at 12.5 s"),
        (12.5, 3.0, "from 12.5 s to 15.5 s"),
    ],
)
def test_a_change_within_the_last_digit_of_its_time_is_at_once(onset: float, duration: float, when: str) -> None:
    effect = told("heat_loss", "time", "ramp", amplitude=0.6, onset=onset, duration=duration)
    assert words_of_effect(MODEL, effect) == f"heat loss rose by 82 % {when}"


def test_an_event_that_is_not_over_is_told_as_far_as_the_record_goes() -> None:
    """A feed that goes on rising: neither a time after the end, nor a size that nobody saw."""
    onset, constant, end = 12000.0, 9000.0, 28800.0
    effect = told("heat_loss", "time", "washout", half=0.01, amplitude=0.1, onset=onset, time_constant=constant)
    time = np.linspace(0.0, end, 161)
    change = np.exp(0.1 * (1 - np.exp(-np.maximum(time - onset, 0.0) / constant)))
    reached = 100 * float(np.expm1(0.1 * (1 - np.exp(-(end - onset) / constant))))
    said = words_of_effect(MODEL, effect, curve(effect, time, change, "s", relative=True))
    assert said == f"heat loss rose by {reached:.2g} % from 12000 s to the end of the record"
    over = replace(effect, effect=replace(effect.effect, coefficients={**effect.effect.coefficients, "onset": 100.0}))
    shown = curve(over, time, change, "s", relative=True)
    assert "from 100 s to 27100 s" in words_of_effect(MODEL, over, shown)


def test_a_curve_in_time_is_told_by_its_largest_change_and_a_course_by_its_range() -> None:
    time = np.linspace(0.0, 1000.0, 161)
    effect = told("heat_loss", "time", "curve")
    falling = curve(effect, time, 1.0 - 0.3 * time / 1000, "s", relative=True)
    assert words_of_effect(MODEL, effect, falling).startswith("heat loss fell by 29 % from 25 s to 975 s")
    wanders = told("heat_loss", "time", "polyline")
    up_and_down = curve(wanders, time, 1.0 + 0.2 * np.sin(time / 50), "s", relative=True)
    assert words_of_effect(MODEL, wanders, up_and_down) == "heat loss wanders in time, between 20 % less and 20 % more"


def test_the_values_of_a_course_have_one_line_in_the_table_of_coefficients(draught: Discovery) -> None:
    knots = tuple(float(k) for k in range(96))
    values = {f"value_{k + 1}": 0.1 for k in range(96)}
    wanders = NamedEffect(Effect("heat_loss", "time", "polyline", values, {"knots": knots}), "", {}, ())
    table = coefficient_table(replace(draught, verdict=replace(draught.verdict, effects=(wanders,))))
    assert [row[0] for row in table.rows] == ["96 values at knots"]
