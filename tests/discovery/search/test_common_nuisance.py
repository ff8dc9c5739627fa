"""Rivals with what the best lacks added: they are compared anew, and what all lack no longer makes them uncertain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import SearchResult
from adaptive_flot.discovery.search.common_nuisance import MOST_RIVALS, adjust_for_common_nuisance
from adaptive_flot.discovery.search.search import search
from adaptive_flot.discovery.verdict.judge import judge
from tests.discovery.heated import heated_tank, tank_record

ADAPTED = ("efficiency", "loss")


@pytest.fixture(scope="module")
def wandering() -> tuple[Problem, SearchResult]:
    """A draught, and a thermometer that wanders by some hundredths of a kelvin beside it."""
    model, record = heated_tank(), tank_record()
    wander = 0.03 * np.sin(2 * np.pi * record.time / 4000.0)
    record = replace(record, outputs=record.outputs + wander[:, None])
    problem = make_problem(record, model, ADAPTED, burn_in=30, guard=5)
    base = Fitter(problem).fit(model)
    assert base is not None
    return problem, search(problem, base, model)


def _first_round(found: SearchResult) -> SearchResult:
    """The search as it stood with one effect: the wander is what the best of them leaves."""
    return replace(found, alternatives=found.rounds[0].alternatives, left=500.0, left_threshold=10.0)


def test_what_all_lack_is_added_to_all(wandering: tuple[Problem, SearchResult]) -> None:
    problem, found = wandering
    first = _first_round(found)
    near = first.alternatives[1:]
    after = adjust_for_common_nuisance(problem, first, near)
    assert after.common_nuisance is not None and after.common_nuisance != first.alternatives[0].names[0]
    adjusted = [a.adjusted_bic for a in after.alternatives if a.adjusted_bic is not None]
    assert len(adjusted) == 1 + len(near) and adjusted == sorted(adjusted)
    assert {a.names for a in after.alternatives} == {a.names for a in first.alternatives}
    assert after.left < first.left
    assert after.alternatives[0].names == (("heat_loss", "fan_speed"),)
    best = after.alternatives[0]
    for a in after.alternatives[1 : len(adjusted)]:
        assert a.worse_than(best) == pytest.approx((a.adjusted_bic or 0.0) - (best.adjusted_bic or 0.0))


def test_the_comparison_settles_what_the_shortcoming_left_open(wandering: tuple[Problem, SearchResult]) -> None:
    problem, found = wandering
    first = _first_round(found)
    assert judge(first).word != "named"
    verdict = judge(adjust_for_common_nuisance(problem, first, first.alternatives[1:]))
    assert verdict.word == "named" and verdict.best is not None
    assert verdict.best.names == (("heat_loss", "fan_speed"),)


def test_there_is_no_comparison_with_no_one_or_with_too_many(wandering: tuple[Problem, SearchResult]) -> None:
    problem, found = wandering
    assert adjust_for_common_nuisance(problem, found, ()) is found
    assert adjust_for_common_nuisance(problem, found, found.alternatives[:1] * (MOST_RIVALS + 1)) is found


def test_fits_of_other_processes_are_compared_like_ones_own(wandering: tuple[Problem, SearchResult]) -> None:
    """A fit comes back from another process without its model: the comparison ended with an error there."""
    problem, found = wandering
    first = _first_round(found)
    alone, beside = (adjust_for_common_nuisance(problem, first, first.alternatives[1:], n) for n in (1, 2))
    assert beside.common_nuisance == alone.common_nuisance is not None
    assert [a.adjusted_bic for a in beside.alternatives] == pytest.approx([a.adjusted_bic for a in alone.alternatives])
