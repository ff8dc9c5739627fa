"""Alarms stay on the list until they are both over and acknowledged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Decision, Sample, Status
from adaptive_flot.live.alarms import ALL, LASTS, Alarm, acknowledged, after_cycle, conditions, lasting
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.safety.modes import Mode

SAMPLE = Sample(1.0, np.ones(1), np.array([0.25]))
GOOD = Outcome(1, Mode.CLOSED, "", (), {"grade": Check.OK}, SAMPLE, None, None, {}, {}, True)
LIMITS = {"the_grade": (0, 0.2, np.inf, True)}


def test_an_alarm_is_raised_once_and_leaves_when_over_and_acknowledged() -> None:
    alarms, said = after_cycle({}, {"solver": "it failed"}, 5.0)
    assert said == {"solver": "raised: it failed"}
    alarms, said = after_cycle(alarms, {"solver": "it failed"}, 6.0)
    assert said == {} and alarms["solver"].since == 5.0
    over, said = after_cycle(alarms, {}, 7.0)
    assert said == {"solver": "cleared: it failed"} and not over["solver"].active
    assert acknowledged(over, "solver", "A")[0] == {}
    known, _ = acknowledged(alarms, "solver", "A")
    assert known["solver"] == Alarm("solver", "it failed", 5.0, True, "A")
    assert after_cycle(known, {}, 7.0)[0] == {}


def test_an_alarm_that_comes_again_must_be_acknowledged_again() -> None:
    alarms, _ = after_cycle({}, {"a": "x"}, 1.0)
    alarms, _ = after_cycle(alarms, {}, 2.0)
    alarms, said = after_cycle(alarms, {"a": "x"}, 3.0)
    assert said == {"a": "raised: x"} and alarms["a"] == Alarm("a", "x", 3.0)


def test_all_are_acknowledged_at_once_and_an_unknown_one_changes_nothing() -> None:
    alarms, _ = after_cycle({}, {"a": "x", "b": "y"}, 1.0)
    assert all(a.acknowledged == "P" for a in acknowledged(alarms, ALL, "P")[0].values())
    same, words = acknowledged(alarms, "c", "P")
    assert same == alarms and "no such alarm" in words


@pytest.mark.parametrize(
    ("outcome", "key"),
    [
        (replace(GOOD, mode=Mode.SHED), "shed"),
        (replace(GOOD, faults=("no new sample from the plant",)), "no new sample from the plant"),
        (replace(GOOD, faults=("controller: ValueError: 17",)), "controller"),
        (replace(GOOD, checks={"grade": Check.FROZEN}), "tag grade"),
        (replace(GOOD, sample=Sample(1.0, np.ones(1), np.array([0.19]))), "limit the_grade"),
        (replace(GOOD, decision=Decision(np.ones(1), Status.HELD, "mpc")), "solver"),
    ],
)
def test_what_is_wrong_in_a_cycle(outcome: Outcome, key: str) -> None:
    assert list(conditions(outcome, LIMITS)) == [key]


def test_what_is_usual_raises_nothing() -> None:
    late = replace(GOOD, checks={"grade": Check.OLD}, sample=Sample(1.0, np.ones(1), np.array([np.nan])))
    assert conditions(GOOD, LIMITS) == conditions(late, LIMITS) == {}


def test_noise_about_a_limit_raises_no_alarm_and_a_stay_beyond_it_does() -> None:
    wrong, counts = {"limit grade": "below", "shed": "now"}, dict[str, int]()
    for k in range(1, LASTS + 1):
        counts, left = lasting(counts, wrong)
        assert ("limit grade" in left) == (k >= LASTS) and "shed" in left
    counts, _ = lasting(counts, {})
    assert lasting(counts, wrong)[1] == {"shed": "now"}
