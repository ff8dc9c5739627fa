"""Profiles by known values: entry k is what holds in the interval that starts at time k."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from adaptive_flot.runner.scenario.inputs.profiles import Change, InputProfile, RandomWalk

_ADAPTER: TypeAdapter[InputProfile] = TypeAdapter(InputProfile)


def values(time: Any, run: int = 1, /, **content: Any) -> list[float]:
    profile = _ADAPTER.validate_python(content)
    return [float(v) for v in profile.values(np.asarray(time, dtype=float), run)]


def test_constant() -> None:
    assert values([0, 1, 2], profile="constant", value=0.38) == [0.38] * 3


def test_staircase_climbs_in_equal_steps_from_the_first_value_to_the_last() -> None:
    """Six seconds in steps of two: three levels, each from its own start on."""
    assert values(range(6), profile="staircase", **{"from": 1.0, "to": 3.0}, every_s=2) == [1, 1, 2, 2, 3, 3]
    assert values(range(6), profile="staircase", **{"from": 3.0, "to": 1.0}, every_s=2) == [3, 3, 2, 2, 1, 1]


def test_staircase_that_does_not_divide_the_run_still_ends_at_its_last_value() -> None:
    assert values(range(5), profile="staircase", **{"from": 0.0, "to": 1.0}, every_s=2) == [0, 0, 0.5, 0.5, 1]


def test_staircase_longer_than_the_run_stays_at_its_first_value() -> None:
    assert values(range(3), profile="staircase", **{"from": 0.2, "to": 1.0}, every_s=10) == [0.2] * 3


def test_the_paper_s_staircase_has_forty_levels() -> None:
    """2400 s in steps of 60 s, from 9.05e-4 to 2.17e-3 m3/s: 40 equidistant levels of 60 samples."""
    found = values(range(2400), profile="staircase", **{"from": 9.05e-4, "to": 2.17e-3}, every_s=60)
    np.testing.assert_allclose(found, np.repeat(np.linspace(9.05e-4, 2.17e-3, 40), 60), rtol=1e-12)


def test_block_edges_do_not_suffer_from_rounding() -> None:
    """0.1 s sampling: 3 * 0.1 is a little more than 0.3, 0.7 / 0.1 a little less than 7."""
    time = 0.1 * np.arange(12)
    found = values(time, profile="staircase", **{"from": 0.0, "to": 3.0}, every_s=0.3)
    assert found == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert values(time, profile="steps", at_s=[0.0, 0.3, 0.7], values=[0, 1, 2]) == [0] * 3 + [1] * 4 + [2] * 5


def test_steps_hold_each_value_from_its_time_on() -> None:
    assert values([0, 9.5, 10, 11, 30], profile="steps", at_s=[0, 10, 20], values=[1, 5, 2]) == [1, 1, 5, 5, 2]


@pytest.mark.parametrize("at_s", [[1, 2], [0, 2, 1], [0, 2, 2], [0], []])
def test_steps_must_start_at_zero_rise_and_match_their_values(at_s: list[float]) -> None:
    with pytest.raises(ValidationError, match="at_s must rise from 0"):
        values([0], profile="steps", at_s=at_s, values=[1.0, 2.0, 3.0][: max(len(at_s), 2)])


def random(seed: int | str, run: int) -> list[float]:
    return values(range(12), run, profile="random", between=(0.33, 0.42), every_s=4, seed=seed)


def test_random_levels_hold_for_their_period_and_differ() -> None:
    levels = np.reshape(random(5, 1), (3, 4))
    assert np.ptp(levels, axis=1).tolist() == [0.0] * 3
    assert len(set(levels[:, 0])) == 3


def test_a_fixed_seed_gives_every_run_the_same_levels_and_per_run_gives_each_its_own() -> None:
    assert random(5, 1) == random(5, 2) != random(6, 1)
    assert random("per_run", 1) == random("per_run", 1) != random("per_run", 2)
    assert random("per_run", 5) != random(5, 5)


@given(low=st.floats(-10, 10), width=st.floats(0, 10), run=st.integers(0, 2**31))
def test_random_levels_stay_between_their_limits(low: float, width: float, run: int) -> None:
    found = values(range(200), run, profile="random", between=(low, low + width), every_s=1, seed="per_run")
    assert low <= min(found) and max(found) <= low + width


def test_random_levels_of_the_runs_are_not_those_of_the_noise() -> None:
    """One seed makes both: they must not come from one stream."""
    noise = np.random.default_rng([3, 0]).uniform(0.33, 0.42, 3)
    assert not np.allclose(np.reshape(random("per_run", 3), (3, 4))[:, 0], noise)


def test_ramp_factor() -> None:
    change = Change(change=0.2, from_s=10, to_s=20)
    np.testing.assert_allclose(change.factor(np.array([0, 10, 15, 20, 99.0])), [1, 1, 1.1, 1.2, 1.2])


def test_step_factor_jumps_at_the_start_of_the_ramp() -> None:
    change = Change(profile="step", change=-0.5, from_s=10, to_s=20)
    np.testing.assert_allclose(change.factor(np.array([0, 9, 10, 11, 99.0])), [1, 1, 0.5, 0.5, 0.5])


def test_a_change_needs_its_end_after_its_start() -> None:
    with pytest.raises(ValidationError, match="to_s must lie after from_s"):
        Change(change=0.1, from_s=10, to_s=10)
    with pytest.raises(ValidationError, match=r"20 makes the value 21 times as large; write 0.2 for 20 %"):
        Change(change=20, from_s=10, to_s=20)


def test_a_random_walk_has_the_std_asked_for_after_an_hour_and_rests_before_its_start() -> None:
    """Over many runs; the sampling interval is of no account."""
    walk = RandomWalk(profile="random_walk", share_per_hour=0.1, from_s=100)
    for dt in (1.0, 10.0):
        time = np.arange(0.0, 3700.0, dt)
        paths = np.log([walk.factor(time, seed, "C") for seed in range(400)])
        assert not paths[:, time < 100].any()
        np.testing.assert_allclose(paths[:, -1].std(), 0.1, rtol=0.15)
        half = paths[:, np.searchsorted(time, 1900.0)]
        np.testing.assert_allclose(half.std(), 0.1 * np.sqrt(0.5), rtol=0.15)


def test_a_random_walk_is_another_one_for_each_seed_and_parameter_unless_its_seed_is_given() -> None:
    time = np.arange(50.0)
    walk = RandomWalk(profile="random_walk", share_per_hour=0.1)
    np.testing.assert_array_equal(walk.factor(time, 1, "C"), walk.factor(time, 1, "C"))
    for other in (walk.factor(time, 2, "C"), walk.factor(time, 1, "n")):
        assert abs(np.corrcoef(np.diff(walk.factor(time, 1, "C")), np.diff(other))[0, 1]) < 0.5
    fixed = RandomWalk(profile="random_walk", share_per_hour=0.1, seed=3)
    np.testing.assert_array_equal(fixed.factor(time, 1, "C"), fixed.factor(time, 2, "C"))
