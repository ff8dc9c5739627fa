"""A part that is certain is told where the whole is not: made by hand, and from a record with two things wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Alternative, Discovery, Judgement, Round, SearchResult, Verification, Word
from adaptive_flot.discovery.search.substance import excess_by_output, still_wrong
from adaptive_flot.discovery.verdict.certain_part import with_certain_part
from adaptive_flot.discovery.verdict.judge import judge
from adaptive_flot.discovery.verdict.words.wording import reason_words
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model, Quantity, Scope
from tests.discovery.heated import CAPACITY, DT, ROOM, equations, heated_tank, moves

LOSS, HEATER, SENSOR = ("heat_loss", "fan_speed"), ("heating", "fan_speed"), ("flow_meter", "constant")
CONFIRMED = Verification(0.5, (0.4, 0.6), (), True)


def _equations(m: Scope) -> None:
    equations(m)
    m.output("air", m.site("flow_meter", 0.1 * m.input("fan_speed"), "sensor", unit="m3/s"))


def tank_with_meter() -> Model:
    """A heated tank whose fan has a flow meter, whose efficiency is known, and whose record does not start at rest."""
    tank = heated_tank()
    return replace(
        tank,
        name="metered-tank",
        parameters=tuple(replace(p, role="fixed") if p.name == "efficiency" else p for p in tank.parameters),
        outputs=(*tank.outputs, Quantity("air", "m3/s", "", 0.0, 10.0, 0.1)),
        equations=_equations,
        starts_steady=False,
    )


@pytest.fixture(scope="module")
def two_things() -> Discovery:
    """The heat loss follows the fan, twenty noise deviations, and the flow meter shows 6 % too much, three of its."""
    rng = np.random.default_rng(3)
    inputs = np.column_stack([moves(600, 500, 3000, 40, 100), moves(600, 5, 20, 25, 200)])
    temperature, seen = 305.0, []
    for power, fan in inputs:
        loss = 60.0 * (fan / 10) ** 0.6
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - ROOM)) / CAPACITY
        seen.append((temperature, 0.106 * fan))
    y = np.array(seen) + rng.standard_normal((600, 2)) * [0.05, 0.02]
    return discover(tank_with_meter(), Dataset("tank", DT * np.arange(1.0, 601), DT, inputs, y))


def test_an_output_that_is_slightly_wrong_counts_beside_one_that_is_far_off(two_things: Discovery) -> None:
    """The meter is next to nothing over all outputs, and all that is wrong with its own."""
    assert two_things.search is not None and two_things.problem is not None
    first = two_things.search.rounds[0].alternatives[0]
    base, best = two_things.search.base, two_things.search.alternatives[0].fit
    assert still_wrong(two_things.problem, first.fit) and not still_wrong(two_things.problem, best)
    removed = excess_by_output(two_things.problem, base, best)
    assert removed.min() > 1.0 and removed.max() > 5 * removed.min()
    assert {e.effect.site for e in two_things.verdict.effects} == {"heat_loss", "flow_meter"}


def test_outliers_do_not_make_an_output_wrong(two_things: Discovery) -> None:
    """Two values in a hundred, thirty noise deviations away, would be an error of more than four."""
    assert two_things.search is not None and two_things.problem is not None
    best, problem = two_things.search.alternatives[0].fit, two_things.problem
    outputs = problem.record.outputs.copy()
    outputs[7::50] += 30 * best.noise.stationary_std() * problem.weights[7::50]
    assert not still_wrong(replace(problem, record=replace(problem.record, outputs=outputs)), best)


def _search(found: Discovery, *sets: tuple[tuple[tuple[str, str], ...], float]) -> SearchResult:
    """Sets of effects by how much worse they are than the first, all with its fit; the first round is the record's."""
    assert found.search is not None
    own = found.search.alternatives[0]
    last = tuple(
        Alternative(names, (True,) * len(names), replace(own.fit, bic=own.fit.bic + worse), 0.0, -1e3 + worse)
        for names, worse in sets
    )
    without = tuple(a for a in found.search.rounds[0].alternatives if SENSOR not in a.names)
    rounds = (replace(found.search.rounds[0], alternatives=without), Round((), 10.0, last))
    return replace(found.search, rounds=rounds, alternatives=last, verification=CONFIRMED, left=0.0)


def _judged(result: SearchResult) -> Judgement:
    return Judgement("abstain", result.alternatives[0], (), result.alternatives[1:], 10.0)


def test_what_all_sets_share_is_named_where_the_rest_is_open(two_things: Discovery) -> None:
    result = _search(two_things, ((LOSS, SENSOR), 0.0), ((HEATER, SENSOR), 5.0))
    assert two_things.problem is not None
    judged = with_certain_part(two_things.problem, result, _judged(result))
    assert judged.word == "named" and judged.part == (SENSOR,)
    said = reason_words(judged, result, (), ())
    assert "Something else is off beside it" in said and "heating by fan_speed" in said


def test_one_of_two_that_every_set_has_is_told_as_a_class_wherever_it_stands(two_things: Discovery) -> None:
    """Sets from two first rounds have the part that they share in either place."""
    meter, flow = ("flow_meter", "lag"), ("flow_meter", "time")
    sets = (((SENSOR, LOSS), 0.0), ((LOSS, meter), 5.0), ((HEATER, SENSOR), 6.0), ((meter, ("heat_loss", "time")), 7.0))
    result = _search(two_things, *sets)
    assert two_things.problem is not None
    judged = with_certain_part(two_things.problem, result, _judged(result))
    assert judged.word == "class" and judged.members == (SENSOR, meter) and judged.part == (SENSOR,)
    also = (((flow, LOSS), 8.0), ((("flow_meter", "fan_speed"), HEATER), 9.0), ((meter, ("heating", "time")), 9.5))
    four = _search(two_things, *sets, *also)
    assert with_certain_part(two_things.problem, four, _judged(four)).word == "abstain"


def test_nothing_is_told_of_sets_that_share_nothing_or_where_rows_contradict(two_things: Discovery) -> None:
    assert two_things.problem is not None
    apart = _search(two_things, ((LOSS, SENSOR), 0.0), ((HEATER, ("flow_meter", "lag")), 5.0))
    assert with_certain_part(two_things.problem, apart, _judged(apart)).word == "abstain"
    shared = _search(two_things, ((LOSS, SENSOR), 0.0), ((HEATER, SENSOR), 5.0))
    refuted = replace(shared, verification=replace(CONFIRMED, confirmed=False))
    assert with_certain_part(two_things.problem, refuted, _judged(refuted)).word == "abstain"


def test_a_part_that_no_output_needs_is_not_told(two_things: Discovery) -> None:
    """All sets share it, but the best set without it repairs the same outputs."""
    assert two_things.problem is not None
    third = (("heat_loss", "time"), SENSOR)
    fourth = (("heating", "time"), SENSOR)
    result = _search(two_things, ((LOSS, SENSOR), 0.0), ((HEATER, SENSOR), 5.0), (third, 6.0), (fourth, 7.0))
    judged = with_certain_part(two_things.problem, result, _judged(result))
    assert judged.part == (SENSOR,)
    best = result.alternatives[0]
    alike = replace(best, names=(LOSS, ("flow_meter", "fan_speed")), fit=replace(best.fit, bic=best.fit.bic + 100))
    result = replace(result, rounds=(*result.rounds, Round((), 10.0, (alike,))))
    assert with_certain_part(two_things.problem, result, _judged(result)).word == "abstain"


def test_what_all_sets_share_is_not_certain_while_an_output_stays_wrong(two_things: Discovery) -> None:
    result = _search(two_things, ((LOSS, SENSOR), 0.0), ((HEATER, SENSOR), 5.0))
    judged = replace(_judged(result), word="class", members=(LOSS, HEATER, SENSOR))
    assert "Certain: flow meter shows 6.1 % too much." in reason_words(judged, result, (), ())
    said = reason_words(judged, result, (), (), wrong=["temperature"])
    assert "All that come near have flow_meter by constant; still wrong: temperature." in said and "Certain" not in said


@pytest.mark.parametrize("word", ["named", "unnamed"])
def test_an_output_that_stays_wrong_is_said_beside_a_name(two_things: Discovery, word: Word) -> None:
    """A name that leaves an error far above the noise is not all there is, or not the right one."""
    result = _search(two_things, ((LOSS, SENSOR), 0.0))
    judged = replace(_judged(result), word=word)
    assert "Still far above" not in reason_words(judged, result, (), ())
    said = reason_words(judged, result, (), (), wrong=["concentrate_grade"])
    assert said.endswith("Still far above the noise: concentrate grade.")


def test_two_dependences_of_one_quantity_are_no_two_causes(two_things: Discovery) -> None:
    """One dependence of another shape would look the same. What stands at a site of its own is certain all the same."""
    both = _search(two_things, ((LOSS, ("heat_loss", "time"), SENSOR), 0.0))
    judged = judge(both)
    assert judged.word == "class" and set(judged.members) == set(both.alternatives[0].names)
    said = reason_words(judged, both, (), ())
    assert "Certain: flow meter shows 6.1 % too much. heat_loss depends on fan_speed or time, or on both" in said
    assert "can not tell these apart" not in said
    apart = _search(two_things, ((LOSS, ("heating", "time"), SENSOR), 0.0))
    assert judge(apart).word == "named"
