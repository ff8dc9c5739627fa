"""What is told when an effect does not hold on rows that did not fit it: the search behind is a stand-in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations import judge as judging
from adaptive_flot.discovery.innovations.late import late_where
from tests.discovery.innovations.told.judged.given import SPAN, Given, Stand, event, lag, told


def test_an_effect_that_predicts_no_fresh_rows_is_not_named_and_not_called_nothing() -> None:
    """A large gain on the rows that fitted is not "constants and process noise explain it"."""
    said = told(Given((lag("sensor"),), 500.0, -1.0))
    assert said.word == "abstain"
    assert "sensor lag predicts no rows" in said.why


def test_a_pair_of_which_neither_holds_alone_is_told_as_nothing_named() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, -1.0), Given((one,), 400.0, -0.5), Given((two,), 3.0, -0.2))
    assert said.word == "abstain"
    assert "sensor" in said.why or "valve" in said.why


def test_an_effect_that_holds_is_named_beside_one_that_does_not() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, 0.5), Given((one,), 400.0, 0.6), Given((two,), 3.0, 0.01))
    assert said.word == "named"
    assert [h.site for h in said.certain] == ["sensor"]


def test_a_small_effect_beside_a_large_one_is_not_told() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, 0.9), Given((one,), 480.0, 0.5), Given((two,), 30.0, 0.1))
    assert said.word == "named"
    assert [h.site for h in said.certain] == ["sensor"]


def test_a_lag_and_a_dead_time_of_one_part_are_two_effects() -> None:
    """Measured: a throttle motor. Both are a "throttle_motor lag", and the one for the other was a crash."""
    slow = lag("motor")
    late = replace(slow, driver="delay", effect=replace(slow.effect, driver="delay", form="delay"))
    pair, best = Given((slow, late), 500.0, 0.9), Given((slow,), 490.0, 0.8)
    said = told(pair, Given((late,), 450.0, 0.5), best)
    assert said.word == "named" and said.certain == (slow,)
    assert said.best.criterion == best.criterion


def test_nothing_is_missing_where_no_explanation_gains() -> None:
    assert told(Given((lag("sensor"),), 5.0, 0.1)).word == "none"


@pytest.mark.parametrize(
    ("hull", "indicator", "fresh", "word"),
    [(480.0, 300.0, 0.5, "named"), (None, 300.0, 0.5, "abstain"), (480.0, 300.0, -0.5, "abstain")],
)
def test_an_event_is_told_without_a_partner_that_would_have_to_be_too_large(
    hull: float | None, indicator: float, fresh: float, word: str
) -> None:
    """Measured: a rudder lost force, and a span of the gyro at its limit took up what else the model lacks.

    The event must be found alone, and must predict fresh rows.
    """
    force = event("rudder", (800.0, 1200.0))
    pair, other = Given((force, SPAN), 600.0, 0.7, slope=0.3), Given((lag("indicator"),), indicator, 0.3)
    alone = [Given((force,), hull, fresh)] if hull else []
    said = told(pair, *alone, other, Given((SPAN,), 100.0, 0.1, slope=0.3))
    assert said.word == word, said.why
    assert [h.site for h in said.certain] == (["rudder"] if word == "named" else [])


@pytest.mark.parametrize(("slope", "word"), [(-0.1, "named"), (-0.2999, "abstain"), (0.3, "abstain")])
def test_a_fault_at_the_end_of_its_range_is_no_explanation(slope: float, word: str) -> None:
    """Though it predicts fresh rows and fits best: the record asks for more than such a fault can give."""
    said = told(Given((SPAN,), 500.0, 0.5, slope=slope), Given((lag("valve"),), 300.0, 0.4))
    assert said.word == word
    assert word == "named" or "larger than such a fault can be" in said.why


def test_a_fault_at_the_end_of_its_range_that_gains_nothing_is_nothing() -> None:
    assert told(Given((SPAN,), 1.0, 0.0, slope=0.3)).word == "none"


def test_a_fault_that_reaches_the_end_of_its_range_alone_is_not_told_without_what_was_beside_it() -> None:
    """Heat of a second reaction: a thermometer with a span 30 % larger, once the pump's offset was left out."""
    beside = lag("pump")
    pair, alone = Given((SPAN, beside), 500.0, 0.9, slope=0.2), Given((SPAN,), 480.0, 0.5, slope=0.3)
    said = told(pair, alone, Given((beside,), 30.0, 0.1))
    assert said.word == "abstain" and "larger than such a fault can be" in said.why


def test_pairs_that_share_no_effect_are_no_class_of_single_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each explanation has two effects: "one of these two sites" would be false of all of them."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    x, y = lag("sensor"), lag("valve")
    x_late, y_late = (replace(h, driver="time", effect=replace(h.effect, driver="time")) for h in (x, y))
    pairs = Given((x_late, y), 500.0, 0.5), Given((y_late, x), 499.0, 0.5)
    singles = [Given((h,), 100.0, 0.1) for h in (x, y)]
    search: Any = Stand(Given((), 0.0, 0.0), *pairs, *singles)
    ranked: Any = [*pairs, Given((), 0.0, 0.0)]
    assert judging.judge(search, ranked[-1], ranked).word == "abstain"


def test_one_part_that_is_limited_or_has_stopped_is_a_class_of_the_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured: a heater that gives 55 % at most, and was asked for more from some time on. Its place is certain."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    said = told(Given((lag("heater"),), 500.0, 0.5), Given((event("heater", (800.0, 1200.0)),), 499.0, 0.5))
    assert said.word == "class" and said.certain == ()
    assert [(h.site, h.kind) for _, h in said.open] == [("heater", "lag"), ("heater", "switch")]


@pytest.mark.parametrize(("alone", "word", "open_ones"), [(480.0, "named", []), (300.0, "class", ["valve", "duct"])])
def test_a_small_effect_that_is_one_of_two_is_not_told_either(
    alone: float, word: str, open_ones: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is certain by itself brings 480 or 300 of 500."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: len(other.hypotheses) < 2)
    late, one, two = lag("sensor"), lag("valve"), lag("duct")
    said = told(
        Given((late, one), 500.0, 0.9),
        Given((late, two), 499.0, 0.9),
        Given((late,), alone, 0.5),
        Given((one,), 30.0, 0.1),
        Given((two,), 30.0, 0.1),
    )
    assert said.word == word
    assert [h.site for h in said.certain] == ["sensor"]
    assert [h.site for _, h in said.open] == open_ones


@pytest.mark.parametrize(("alike", "word"), [("elsewhere", "class"), ("nowhere", "named")])
def test_a_lag_that_a_free_run_does_not_tell_from_another_is_a_class_with_that(alike: str, word: str) -> None:
    """The filter has the other one at half of the gain, by how it lets the process wander."""
    search: Any = Stand(Given((), 0.0, 0.0))
    named = told(Given((lag("sensor"),), 500.0, 1.0))
    assert named.word == "named"
    again = late_where(search, named, lambda _, site: site == alike)
    assert again.word == word
    assert {h.site for h in again.effects} == ({"sensor", "elsewhere"} if word == "class" else {"sensor"})


def test_an_effect_more_beside_one_of_a_class_is_no_other_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gains by wind, or the loss by wind, or the loss by wind and something else: one of the first two."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    one, two, more = lag("gains"), lag("loss"), lag("heater")
    said = told(Given((one,), 500.0, 0.9), Given((two,), 498.0, 0.9), Given((two, more), 505.0, 0.9))
    assert said.word == "class" and not said.certain
    assert [h.site for _, h in said.open] == ["gains", "loss"]


def test_a_lag_elsewhere_with_something_more_is_no_other_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lags commute: a late amplifier, or a late tachometer and a load, are a lag, and a lag with a load."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    one, two, load = lag("amplifier"), lag("tachometer"), event("load", (100.0, 300.0))
    monkeypatch.setattr(judging, "at_steps_of_an_input", lambda search, e: ())
    said = told(Given((one,), 500.0, 0.9), Given((two, load), 505.0, 0.9), Given((two,), 490.0, 0.8))
    assert said.word == "class" and [h.site for _, h in said.open] == ["amplifier", "tachometer"]
