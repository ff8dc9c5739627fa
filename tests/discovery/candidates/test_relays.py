"""A switch with two thresholds is found by its memory: on a tank whose vent opens when hot and closes when cool.

The truth is a thermostat in plain Python, which latches at once; the form of the package is a smooth flip-flop.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.shapes.relays import (
    LEAST_MOVES,
    RELAY,
    TWO_LEVELS,
    course,
    late,
    moves_often,
    with_relays,
)
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.results import NamedEffect
from adaptive_flot.discovery.search.rounds import scorer_of, threshold_of
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.discovery.verdict.words.sizes import words_of_effects
from adaptive_flot.discovery.verdict.words.thresholds import SETTLES, same_course
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from tests.discovery.heated import CAPACITY, DT, NOISE, ROOM, Truth, changed, heated_tank, moves, tank_record

OPENS, CLOSES, MORE = 14.0, 9.0, 0.5
"""Fan speeds above which the vent opens and below which it closes [1/s], and how much more heat is then lost."""


def latched(driver: FloatArray, on_above: float, off_below: float) -> list[bool]:
    """A switch as one would wire it, row by row; it starts as the nearer threshold says."""
    is_on, seen = bool(driver[0] > 0.5 * (on_above + off_below)), []
    for value in driver:
        is_on = bool(value > on_above or (is_on and value >= off_below))
        seen.append(is_on)
    return seen


def vented(rows: int = 700, seed: int = 0, more: float = MORE) -> Dataset:
    """Record of a tank with a vent that the fan blows open; what it lets out does not depend on the fan otherwise."""
    inputs = np.column_stack([moves(rows, 500, 3000, 40, seed + 100), moves(rows, 5, 20, 9, seed + 200)])
    temperature, seen = 305.0, []
    for (power, _), is_open in zip(inputs, latched(inputs[:, 1], OPENS, CLOSES), strict=True):
        loss = 60.0 * (1 + more * is_open)
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - ROOM)) / CAPACITY
        seen.append(temperature)
    y = np.array(seen) + NOISE * np.random.default_rng(seed).standard_normal(rows)
    return Dataset("tank", DT * np.arange(1.0, rows + 1), DT, inputs, y[:, None])


def scored(record: Dataset) -> Scorer:
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5, cycles=20)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return scorer_of(problem, fit)[0]


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.floats(-1, 1), st.floats(0.0, 1.5))
def test_the_course_of_a_switch_is_that_of_a_latch(seed: int, off_below: float, band: float) -> None:
    driver = np.random.default_rng(seed).normal(size=80).cumsum() / 3
    expected = latched(driver, off_below + band, off_below)
    assert course(driver, off_below + band, off_below).tolist() == expected


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.floats(-1, 1), st.floats(0.0, 1.5), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_thresholds_may_lie_anywhere_in_their_ranges(
    seed: int, off_below: float, band: float, first: float, second: float
) -> None:
    """Along a driver that stays for some rows wherever it goes."""
    driver = np.repeat(np.random.default_rng(seed).normal(size=60).cumsum() / 3, 6)
    plain = course(driver, off_below + band, off_below)
    upper, lower = same_course(driver, plain)
    assert upper[0] <= off_below + band <= upper[1]
    assert lower[0] <= off_below <= lower[1]
    if np.isfinite([*upper, *lower]).all():
        on, off = (low + share * (high - low) for (low, high), share in ((upper, first), (lower, second)))
        moved = course(driver, max(on, off), min(on, off))
        assert np.array_equal(moved[1:], plain[1:]) or plain[0] != moved[0] or on < off


def test_the_form_switches_as_a_latch_does() -> None:
    """The smooth flip-flop of the equations against the same latch, along a driver that crosses both thresholds."""
    relay = Effect(
        "heat_loss", "fan_speed", RELAY, {"amplitude": 0.4, "on_above": OPENS, "off_below": CLOSES}, {"follow_s": DT}
    )
    model = heated_tank().with_effects([relay])
    fan = np.repeat([6.0, 12.0, 16.0, 12.0, 10.0, 8.0, 12.0, 18.0], 30)
    inputs = np.column_stack([np.full(len(fan), 1500.0), fan])
    p = np.array([q.value for q in model.parameters])
    run = Stepper(model, DT).simulate(np.array([305.0, 0.0]), inputs, p, 0.0)
    state = run.states[:, model.names("states").index("heat_loss_by_fan_speed.on")]
    settled = np.arange(len(fan)) % 30 > 2
    assert np.abs(state - np.array(latched(fan, OPENS, CLOSES)))[settled].max() < 0.02


def test_a_switch_of_size_zero_leaves_the_model_as_it_is() -> None:
    record, model = vented(120), heated_tank()
    relay = Effect("heat_loss", "fan_speed", RELAY, {"on_above": OPENS, "off_below": CLOSES}, {"follow_s": DT})
    extended = model.with_effects([relay])
    own, other = (np.array([q.value for q in m.parameters]) for m in (model, extended))
    plain = Stepper(model, DT).simulate(np.array([305.0]), record.inputs, own, 0.0)
    with_it = Stepper(extended, DT).simulate(np.array([305.0, 0.0]), record.inputs, other, 0.0)
    assert np.array_equal(plain.outputs, with_it.outputs)


def test_a_switch_scores_better_than_any_curve_over_the_same_signal() -> None:
    scorer = scored(vented())
    best = with_relays(scorer, scorer.scores())[0]
    assert (best.candidate.site.name, best.candidate.driver) == ("heat_loss", "fan_speed")
    assert best.variant.effect.form == RELAY
    plain = next(s for s in scorer.scores() if s.candidate.name == best.candidate.name)
    assert best.penalised > plain.penalised + 50
    (x,) = scorer.projected_profiles(list(best.variant.profiles)).T
    assert best.gain == pytest.approx(float(x @ scorer.residual) ** 2 / float(x @ x), rel=1e-6)


@pytest.mark.parametrize("off", [-1.0, 2.0])
def test_a_switch_that_is_off_may_have_a_level_of_its_own(off: float) -> None:
    """The thermometer shows 1.5 K more while the fan is fast, and another error else."""
    plain = tank_record(Truth(exponent=0.0))
    is_on = np.array(latched(plain.inputs[:, 1], OPENS, CLOSES))
    scorer = scored(changed(plain, plain.outputs[:, 0] + np.where(is_on, 1.5, off)))
    best = with_relays(scorer, scorer.scores())[0]
    assert (best.candidate.site.name, best.candidate.driver) == ("thermometer", "fan_speed")
    assert best.variant.effect.form == TWO_LEVELS
    assert best.start["on"] - best.start["off"] == pytest.approx(1.5 - off, rel=0.1)
    assert best.start["off"] == pytest.approx(off, abs=0.3)
    X = scorer.projected_profiles(list(best.variant.profiles))
    fitted = X @ np.linalg.lstsq(X, scorer.residual, rcond=None)[0]
    assert best.gain == pytest.approx(float(scorer.residual @ fitted), rel=1e-6)
    assert best.penalised == pytest.approx(best.gain - 4 * np.log(scorer.measurements))


def test_a_switch_with_two_levels_is_told_with_both() -> None:
    model = heated_tank()
    values = {"off": -0.5, "on": 0.4, "on_above": OPENS, "off_below": CLOSES}
    effect = Effect("heat_loss", "fan_speed", TWO_LEVELS, values, {"follow_s": DT})
    said = words_of_effects(model, [NamedEffect(effect, "", {"off": (-0.6, -0.4), "on": (0.3, 0.5)}, ())], [])
    assert said == (
        "Heat loss is 49 % larger once fan speed has risen above 14 1/s, until it falls below 9 1/s, "
        "and is 39 % smaller otherwise"
    )


@pytest.mark.parametrize("seed", range(3))
def test_noise_has_no_switch_above_the_threshold(seed: int) -> None:
    scorer = scored(vented(more=0.0, seed=seed))
    assert with_relays(scorer, scorer.scores())[0].penalised < threshold_of(scorer)


def test_what_moves_once_or_twice_is_no_switch() -> None:
    """A step or a pulse in time would say the same."""
    record = vented()
    fan = np.full(len(record.time), 6.0)
    fan[200:450] = 18.0
    scorer = scored(replace(record, inputs=np.column_stack([record.inputs[:, 0], fan])))
    assert LEAST_MOVES > 2
    assert not any(
        s.variant.effect.form == RELAY and s.candidate.driver == "fan_speed"
        for s in with_relays(scorer, scorer.scores())
    )


def test_a_switch_is_told_with_its_size_and_both_thresholds() -> None:
    found = discover(heated_tank(), vented())
    verdict = found.verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("heat_loss", "fan_speed", RELAY)
    low, high = told.interval95["amplitude"]
    assert np.exp(low) - 1 < MORE < np.exp(high) - 1
    record = vented()
    found_at = told.effect.coefficients["on_above"], told.effect.coefficients["off_below"]
    moved = course(record.inputs[:, 1], *found_at) != np.array(latched(record.inputs[:, 1], OPENS, CLOSES))
    assert moved.mean() < 0.03, "thresholds may lie anywhere between two speeds of the record, and nowhere else"
    for name, true in (("on_above", OPENS), ("off_below", CLOSES)):
        least, most = told.interval95[name]
        assert least < true < most, "the threshold is where no row says anything, and the interval says so"
    said = words_of_effects(heated_tank(), [told], [])
    assert said.startswith("Heat loss is ") and "larger once fan speed has risen above" in said
    assert "until it falls below" in said
    assert found.problem is not None and found.after is not None
    (curve,) = effect_curves(found.problem, found.after, 1)
    between = np.argmin(np.abs(curve.driver - np.mean(found_at)))
    assert curve.falling is not None
    assert curve.change[between] == pytest.approx(1.0)
    assert curve.falling[between] == pytest.approx(1 + MORE, rel=0.1)


def test_a_switch_that_a_fit_made_a_step_of_is_none() -> None:
    """Thresholds so far apart that the switch goes on once: a step in time by another name."""
    problem = make_problem(vented(), heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5, cycles=20)
    for thresholds, often in (((OPENS, CLOSES), True), ((OPENS, 1.0), False)):
        size = {"amplitude": 0.4, "on_above": thresholds[0], "off_below": thresholds[1]}
        relay = Effect("heat_loss", "fan_speed", RELAY, size, {"follow_s": DT})
        fit = Fitter(problem).fit(heated_tank().with_effects([relay]), steps=1, rounds=1)
        assert fit is not None
        assert moves_often(problem, fit, relay) == often
        assert moves_often(problem, fit, Effect("heat_loss", "constant", "shift"))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.floats(2.0, 60.0))
def test_a_slow_switch_moves_as_its_equation_does(seed: int, rows: float) -> None:
    """Against the difference equation row by row: between the thresholds it stays where it has got to."""
    driver = np.repeat(np.random.default_rng(seed).normal(size=20), 7)
    share, at = 1 - np.exp(-1 / rows), float(course(driver, 0.5, -0.5)[0])
    for value, found in zip(driver, late(driver, 0.5, -0.5, rows), strict=True):
        at = at + share * (1 - at) if value > 0.5 else at - share * at if value < -0.5 else at
        assert found == pytest.approx(at, abs=1e-12)
    assert late(driver, 0.5, -0.5, 1.0).tolist() == course(driver, 0.5, -0.5).astype(float).tolist()


@pytest.mark.parametrize("rows", [1.0, 12.0, 36.0])
def test_a_slow_switch_has_the_thresholds_of_a_quick_one(rows: float) -> None:
    """Along a sine: the ranges hold the true thresholds, though the switch is half way long after they are passed."""
    driver = np.sin(2 * np.pi * np.arange(2000) / 400)
    is_on = late(driver, 0.5, -0.5, rows) > 0.5
    upper, lower = same_course(driver, is_on, SETTLES + int(np.ceil(np.log(2) * rows)))
    assert upper[0] <= 0.5 <= upper[1] and lower[0] <= -0.5 <= lower[1]
