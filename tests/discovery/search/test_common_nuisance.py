"""Rivals granted what the best lacks: they are compared anew, and what all lack no longer counts as doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.search.common_nuisance import MOST_RIVALS, contest
from adaptive_flot.discovery.search.search import Search, search
from adaptive_flot.discovery.verdict.verdict import judge
from tests.discovery.heated import heated_tank, tank_record

ADAPTED = ("efficiency", "loss")


@pytest.fixture(scope="module")
def wandering() -> tuple[Problem, Search]:
    """A draught, and a thermometer that wanders by some hundredths of a kelvin beside it."""
    model, record = heated_tank(), tank_record()
    wander = 0.03 * np.sin(2 * np.pi * record.time / 4000.0)
    record = replace(record, outputs=record.outputs + wander[:, None])
    problem = make_problem(record, model, ADAPTED, burn_in=30, guard=5)
    base = Fitter(problem).fit(model)
    assert base is not None
    return problem, search(problem, base, model)


def _first_round(found: Search) -> Search:
    """The search as it stood with one effect: the wander is what the best of them leaves."""
    return replace(found, alternatives=found.rounds[0].alternatives, left=500.0, left_threshold=10.0)


def test_what_all_lack_is_granted_to_all(wandering: tuple[Problem, Search]) -> None:
    problem, found = wandering
    first = _first_round(found)
    near = first.alternatives[1:]
    after = contest(problem, first, near)
    assert after.granted is not None and after.granted != first.alternatives[0].names[0]
    told = [a.told for a in after.alternatives if a.told is not None]
    assert len(told) == 1 + len(near) and told == sorted(told)
    assert {a.names for a in after.alternatives} == {a.names for a in first.alternatives}
    assert after.left < first.left
    assert after.alternatives[0].names == (("heat_loss", "fan_speed"),)
    best = after.alternatives[0]
    for a in after.alternatives[1 : len(told)]:
        assert a.worse_than(best) == pytest.approx((a.told or 0.0) - (best.told or 0.0))


def test_a_contest_settles_what_the_shortcoming_left_open(wandering: tuple[Problem, Search]) -> None:
    problem, found = wandering
    first = _first_round(found)
    assert judge(first).word != "named"
    verdict = judge(contest(problem, first, first.alternatives[1:]))
    assert verdict.word == "named" and verdict.best is not None
    assert verdict.best.names == (("heat_loss", "fan_speed"),)


def test_there_is_no_contest_with_no_one_or_with_too_many(wandering: tuple[Problem, Search]) -> None:
    problem, found = wandering
    assert contest(problem, found, ()) is found
    assert contest(problem, found, found.alternatives[:1] * (MOST_RIVALS + 1)) is found
