"""What one cause alone may explain is not told as two: a size that vanished, one signal, one course in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import Alternative, Discovery, Judgement, State
from adaptive_flot.discovery.search.simplify import refitted
from adaptive_flot.discovery.verdict.idle_effects import without_what_vanished
from adaptive_flot.discovery.verdict.judge import judge, same_signal
from adaptive_flot.discovery.verdict.one_course import heed_one_course
from adaptive_flot.discovery.verdict.words.wording import reason_words
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import heated_tank

FAN, HEATER, SENSOR = ("heat_loss", "fan_speed"), ("heating", "fan_speed"), ("thermometer", "constant")
KNOTS = tuple(float(k) for k in np.linspace(0.0, 18000.0, 7))


def _both(found: Discovery, further: Effect, bic: float | None = None) -> Alternative:
    """What was found with a further effect beside it, fitted."""
    assert found.search is not None and found.problem is not None
    best = found.search.alternatives[0]
    effects = [*(replace(e, coefficients={}) for e in best.effects), further]
    fit = refitted(Fitter(found.problem), found.search.base, best, effects)
    assert fit is not None
    name = further.site, further.driver
    fit = fit if bic is None else replace(fit, bic=bic)
    base = found.search.base
    return Alternative((*best.names, name), (True, True), fit, base.loss - fit.loss, fit.bic - base.bic)


def test_an_effect_whose_size_has_vanished_is_left_out(draught: Discovery) -> None:
    """Beside the draught nothing is wrong with the thermometer, and its offset may be anything about zero."""
    assert draught.search is not None and draught.problem is not None
    both = _both(draught, Effect("thermometer", "constant", "shift"))
    found = replace(draught.search, alternatives=(both,))
    judged = replace(judge(draught.search), word="named", best=both)
    result, judged = without_what_vanished(draught.problem, found, judged)
    assert judged.best is not None and judged.best.names == (FAN,) == result.alternatives[0].names
    assert judged.word == "named"
    assert result.verification is not None and result.verification.confirmed


def test_what_comes_near_with_what_vanished_stays_a_rival(draught: Discovery) -> None:
    """The heater's dependence on the fan is as near beside the idle thermometer: without it, it is still there."""
    assert draught.search is not None and draught.problem is not None
    idle = Effect("thermometer", "constant", "shift")
    both, own = _both(draught, idle), draught.search.alternatives[0]
    fit = refitted(
        Fitter(draught.problem),
        draught.search.base,
        own,
        [Effect("heating", "fan_speed", "power", settings=own.effects[0].settings), idle],
    )
    assert fit is not None
    near = replace(both, names=(HEATER, SENSOR), fit=replace(fit, bic=both.fit.bic + 1.0))
    judged = replace(judge(draught.search), word="class", best=both, members=(FAN, HEATER))
    result, _ = without_what_vanished(
        draught.problem, replace(draught.search, alternatives=(both, near), rounds=()), judged
    )
    assert [a.names for a in result.alternatives] == [(FAN,), (HEATER,)]


def test_a_joint_search_keeps_what_it_found(draught: Discovery) -> None:
    """It weighs its evidence in another way, and has no rows that it did not fit."""
    assert draught.search is not None and draught.problem is not None
    both = _both(draught, Effect("thermometer", "constant", "shift"))
    judged = replace(judge(draught.search), word="named", best=both)
    found = replace(draught.search, alternatives=(both,))
    joint = replace(draught.problem, whiten=False)
    assert without_what_vanished(joint, found, judged) == (found, judged)


def test_an_effect_that_the_fit_needs_stays(draught: Discovery) -> None:
    """Here the draught is the further one: without it nothing is explained."""
    assert draught.search is not None and draught.problem is not None
    both = _both(draught, Effect("thermometer", "constant", "shift"))
    needed = replace(both, fit=replace(both.fit, bic=both.fit.bic - 100.0))
    judged = replace(judge(draught.search), word="named", best=needed)
    result, judged = without_what_vanished(draught.problem, replace(draught.search, alternatives=(needed,)), judged)
    assert judged.best is needed and result.alternatives == (needed,)


def test_two_dependences_on_one_signal_are_a_class(draught: Discovery) -> None:
    """One of them, of a shape that its form does not draw, leaves an error for the other one."""
    assert draught.search is not None
    best = draught.search.alternatives[0]
    two = replace(best, names=(FAN, HEATER), known=(True, True))
    found = replace(draught.search, alternatives=(two,), left=0.0, left_threshold=10.0)
    judged = judge(found)
    assert judged.word == "class" and set(judged.members) == {FAN, HEATER}
    said = reason_words(judged, found, (), ())
    assert "heat_loss or heating depends on fan_speed, or both" in said
    assert "Certain" not in said


def test_what_all_have_is_certain_though_the_best_has_another_on_its_signal(draught: Discovery) -> None:
    assert draught.search is not None
    best = draught.search.alternatives[0]
    two = replace(best, names=(FAN, HEATER), known=(True, True))
    near = replace(best, names=(FAN, ("thermometer", "time")), known=(True, True))
    found = replace(draught.search, alternatives=(two, near), left=0.0, left_threshold=10.0)
    said = reason_words(judge(found), found, (), ())
    assert "Certain: heat loss depends on fan speed." in said and "or both" not in said


def test_two_dependences_on_different_signals_are_no_class() -> None:
    assert same_signal((FAN, ("heating", "power"), SENSOR, ("thermometer", "time"), ("heating", "time"))) == ()


def _state(found: Discovery, *values: np.ndarray) -> State:
    """A discovery as if curves in time at the loss, the heater and the thermometer had been named."""
    assert found.search is not None and found.problem is not None
    sites = ("heat_loss", "heating", "thermometer")
    effects = [
        Effect(site, "time", "curve", {f"value_{k + 1}": float(v) for k, v in enumerate(each)}, {"knots": KNOTS})
        for site, each in zip(sites, values, strict=False)
    ]
    own = found.search.alternatives[0]
    names = tuple((e.site, e.driver) for e in effects)
    fit = replace(own.fit, model=heated_tank().with_effects(effects))
    best = replace(own, names=names, known=(True,) * len(names), fit=fit)
    screening = Screening(found.problem.record, (), ())
    return State(
        found.model, found.problem.adapted, None, None, 1, lambda stage: None, screening, problem=found.problem,
        base=found.search.base, search=found.search, judgement=Judgement("named", best, (), (), 10.0),
    )  # fmt: skip


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.2, 3.0), st.sampled_from([-1.0, 1.0]), st.floats(-0.5, 0.5))
def test_one_course_in_time_at_two_places_is_not_told(
    draught: Discovery, seed: int, size: float, sign: float, level: float
) -> None:
    """Whatever the sizes, signs and levels of the two."""
    course = np.random.default_rng(seed).normal(0, 0.2, len(KNOTS)).cumsum() + np.array([0, 1, -1, 1, -1, 0, 0])
    told = heed_one_course(_state(draught, course, sign * size * course + level))
    assert told.judged.word == "abstain"
    assert f"heat loss and heating change with one course in time (correlation {sign:.2f})" in told.contradiction


def test_courses_that_turn_at_different_times_are_two_causes(draught: Discovery) -> None:
    early, late = np.array([0, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3]), np.array([0, 0, 0, 0, 0, 0.2, 0.2])
    state = _state(draught, early, late)
    assert heed_one_course(state) is state


def test_a_course_beside_a_level_is_no_common_course(draught: Discovery) -> None:
    state = _state(draught, np.linspace(0, 0.4, 7), np.full(7, 0.2))
    assert heed_one_course(state) is state


def test_two_straight_lines_say_nothing_of_one_cause(draught: Discovery) -> None:
    """They have one course whatever is behind them."""
    state = _state(draught, np.linspace(0, 0.4, 7), np.linspace(0.3, -0.2, 7))
    assert heed_one_course(state) is state


def test_parts_that_are_certain_are_asked_for_one_course_too(draught: Discovery) -> None:
    course = np.array([0, 0.3, 0.1, 0.5, 0.2, 0.2, 0.2])
    state = _state(draught, course, course)
    judged = replace(state.judged, part=state.judged.best.names)  # type: ignore[union-attr]
    told = heed_one_course(replace(state, judgement=judged, likelihood=50.0))
    assert told.judged.word == "abstain" and told.judged.part == () and told.likelihood == 0.0


@pytest.mark.parametrize("word", ["none", "abstain"])
def test_what_is_not_told_stays_as_it_is(draught: Discovery, word: str) -> None:
    course = np.array([0, 0.3, 0.1, 0.5, 0.2, 0.2, 0.2])
    state = _state(draught, course, course)
    state = replace(state, judgement=replace(state.judged, word=word))  # type: ignore[arg-type]
    assert heed_one_course(state) is state
