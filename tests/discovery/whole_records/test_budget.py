"""A search that is ended by its budget never names what it has not compared; one that had time is the same as ever."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.innovations.verdicts import second_opinion as asking
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import Discovery, State
from adaptive_flot.discovery.stages import plan_test
from tests.discovery.heated import heated_tank, tank_record


def test_a_budget_that_is_spent_at_once_gives_a_verdict_without_a_name() -> None:
    found = discover(heated_tank(), tank_record(), budget=1e-6)
    assert found.verdict.word == "abstain" and found.verdict.effects == ()
    assert found.verdict.reason.startswith("The time for the search ended before the rivals had been compared")
    assert any("time for the search ended" in note for note in found.verdict.notes)


def test_a_budget_that_suffices_changes_nothing_and_each_fit_tells_what_is_tried(draught: Discovery) -> None:
    said: list[str] = []
    found = discover(heated_tank(), tank_record(), budget=1e6, progress=said.append)
    assert any("heat_loss by fan_speed" in word for word in said) and "score" in said
    plain = {**draught.verdict.as_dict(), "seconds": 0}
    assert {**found.verdict.as_dict(), "seconds": 0} == plain


def test_a_fit_whose_time_is_up_stays_where_it_began(draught: Discovery) -> None:
    assert draught.problem is not None and draught.before is not None
    late = Fitter(replace(draught.problem, deadline=time.monotonic() - 1.0))
    fit = late.fit(heated_tank(), like=draught.before, start={"loss": 100.0})
    assert fit is not None and fit.values[1] == 100.0 and np.isfinite(fit.loss)


def test_a_test_is_proposed_only_where_time_is_left_for_it(draught: Discovery) -> None:
    """It takes about half of what the first fit took: a budget that ends before is not overrun by it."""
    said: list[str] = []
    screening = Screening(tank_record(), (), ())
    state = State(heated_tank(), (), None, None, 1, said.append, screening, problem=draught.problem)
    state = replace(state, search=draught.search, judgement=draught.judgement, ends=time.monotonic() + 1000.0)
    plan_test(replace(state, base_seconds=1e6))
    assert said == []
    plan_test(replace(state, base_seconds=1.0))
    assert said == ["plan a test"]


@pytest.mark.parametrize("wanted", [True, False])
def test_a_name_that_process_noise_may_deny_is_not_told_unasked(
    monkeypatch: pytest.MonkeyPatch, draught: Discovery, wanted: bool
) -> None:
    """On a measured air handling unit a search that was cut short there named a damper for a heating valve."""
    monkeypatch.setattr(asking, "is_asked", lambda state: wanted)
    screening = Screening(tank_record(), (), ())
    state = State(heated_tank(), (), None, None, 1, print, screening, problem=draught.problem)
    state = replace(state, before=draught.before, after=draught.after, search=draught.search)
    state = replace(state, judgement=draught.judgement, ends=time.monotonic() - 1.0)
    assert state.judged.word == "named"
    asked = asking.second_opinion(state)
    if wanted:
        assert asked.judged.word == "abstain" and "before it could be compared" in asked.contradiction
    else:
        assert asked is state
