"""What is still told where the whole is not: one effect of a set, and a course in the place of a curve in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fallbacks import tell_part_alone, try_as_course
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import Alternative, Discovery, Judgement, Round, SearchResult, State
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.stages import tell_background
from adaptive_flot.discovery.verdict.certain_part import part_alone
from adaptive_flot.greybox.effects import Effect
from tests.discovery.background.test_told_course import OFF, beside_the_room
from tests.discovery.background.test_uncertain_constants import jacketed_tank, record

FAN, TIME, SENSOR = ("heat_loss", "fan_speed"), ("heat_loss", "time"), ("thermometer", "time")


def left_open(found: Discovery, *sets: tuple[tuple[str, str], ...]) -> State:
    """The stages of a discovery as if these sets had come near, the best of them first, and none had been told."""
    assert found.search is not None and found.problem is not None
    first = found.search.rounds[0]
    own = first.alternatives[0]
    last = tuple(
        Alternative(s, (True,) * len(s), replace(own.fit, bic=own.fit.bic - 50 + k), own.gain, own.delta_bic - 50 + k)
        for k, s in enumerate(sets)
    )
    result = replace(found.search, rounds=(first, Round((), 10.0, last)), alternatives=last)
    judged = Judgement("abstain", last[0], (), last[1:], 10.0)
    screening = Screening(found.problem.record, (), ())
    return State(
        found.model, found.problem.adapted, None, None, 1, lambda stage: None, screening, problem=found.problem,
        base=result.base, search=result, judgement=judged, before=found.before, after=found.after,
        error=found.verdict.error,
    )  # fmt: skip


def test_the_effect_that_every_set_has_is_named_where_the_rest_is_not_told(draught: Discovery) -> None:
    state = left_open(draught, (FAN, SENSOR), (FAN, ("heating", "time")))
    told = tell_part_alone(state)
    assert told.judged.word == "named" and told.judged.best is not None
    assert told.judged.best.names == (FAN,)
    said = "Something else is off beside it, which this record does not tell: thermometer by time; or heating by time."
    assert told.certain == said
    assert told.error[0].after < 0.5 * told.error[0].before


def test_an_effect_is_not_certain_that_a_set_goes_without(draught: Discovery) -> None:
    state = left_open(draught, (FAN, SENSOR), (("heating", "fan_speed"), SENSOR))
    assert tell_part_alone(state) is state


def test_an_effect_is_not_certain_that_another_single_one_comes_near(draught: Discovery) -> None:
    state = left_open(draught, (FAN, SENSOR))
    problem, result = state.searched
    first = result.rounds[0]
    best = first.alternatives[0]
    alike = replace(best, names=(("heating", "fan_speed"),), fit=replace(best.fit, bic=best.fit.bic + 5))
    rounds = (replace(first, alternatives=(best, alike)), result.rounds[1])
    assert part_alone(problem, result, state.judged) is not None
    assert part_alone(problem, replace(result, rounds=rounds), state.judged) is None


def test_nothing_is_taken_from_what_is_told(draught: Discovery) -> None:
    state = left_open(draught, (FAN, SENSOR))
    named = replace(state, judgement=replace(state.judged, word="named"))
    assert tell_part_alone(named) is named and try_as_course(named) is named


def test_report_rows_that_contradict_the_effect_have_their_veto(draught: Discovery) -> None:
    """On these rows alone the model as it is, is right."""
    state = left_open(draught, (FAN, SENSOR))
    problem, (before, _) = state.known_problem, state.refitted
    rows = problem.rows("report")
    outputs = problem.record.outputs.copy()
    noise = 0.05 * np.random.default_rng(0).standard_normal((rows.sum(), outputs.shape[1]))
    outputs[rows] = before.predicted[rows] + noise
    spoilt = replace(state, problem=replace(problem, record=replace(problem.record, outputs=outputs)))
    assert tell_part_alone(spoilt) is spoilt


@pytest.fixture(scope="module")
def wandering_exchange() -> State:
    """A tank whose exchange wanders, told as a curve in time that held-out rows have contradicted."""
    problem, base = beside_the_room(record(OFF, wander=2.0, exchange=0.8, seed=2))
    knots = np.linspace(problem.record.time[0], problem.record.time[-1], 6)
    values = {f"value_{k + 1}": 0.0 for k in range(6)}
    curve = Effect("heat_loss", "time", "curve", values, {"knots": tuple(map(float, knots))})
    fit = replace(base, model=base.model.with_effects([curve]))
    best = Alternative((("heat_loss", "time"),), (True,), fit, 20.0, -20.0)
    scorer, sites = scorer_of(problem, base, Responses(problem, base))
    first = Round(tuple(scorer.scores()), 10.0, (best,))
    result = SearchResult(base, (first,), (best,), None, 0.0, 0.0, sites)
    return State(
        jacketed_tank(wanders=True), problem.adapted, None, None, 1, lambda stage: None,
        Screening(problem.record, (), ()), problem=problem, base=base, search=result,
        judgement=Judgement("abstain", best, (), (), 10.0), before=base, after=fit,
        contradiction="on held-out rows it makes the error larger",
    )  # fmt: skip


def test_what_wanders_is_told_as_a_course_where_its_curve_is_contradicted(wandering_exchange: State) -> None:
    """Another site than that of the curve comes out of it: the exchange, or the circulation, a factor of it."""
    told = try_as_course(wandering_exchange)
    assert told.judged.word in ("named", "class") and not told.contradiction
    assert told.judged.best is not None
    assert told.judged.best.names[0] in {("exchange", "time"), ("circulation", "time")}
    told = tell_background(told)
    assert "room" in f"{told.background} {told.screening.notes}"


def test_a_curve_that_nothing_contradicts_stays_a_curve(wandering_exchange: State) -> None:
    quiet = replace(wandering_exchange, contradiction="")
    assert try_as_course(quiet) is quiet
