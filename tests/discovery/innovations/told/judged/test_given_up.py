"""Effects beside others that only draw what is left of a wrong model are given up, and no more than these."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations import judge as judging
from tests.discovery.innovations.told.judged.given import Given, Stand, event, lag, shift, told

AT_STEPS, BETWEEN = ((200.0, 200.0), (600.0, 210.0), (1000.0, 190.0)), ((250.0, 200.0), (650.0, 200.0), (1050.0, 200.0))


def test_what_is_given_up_takes_nothing_else_at_its_site_with_it() -> None:
    """An amplifier that answers late, and beside that an offset there which predicts nothing."""
    late, off = lag("amplifier"), shift("amplifier")
    pair, alone = Given((late, off), 520.0, 0.5), Given((late,), 500.0, 0.6)
    base = Given((), 0.0, 0.0)
    search: Any = Stand(base, pair)
    search.without = lambda e, h: alone if h is off else Given((off,), 3.0, 0.0)
    ranked: Any = [pair, alone, base]
    said = judging.judge(search, ranked[-1], ranked)
    assert said.word == "named" and said.certain == (late,)


@pytest.mark.parametrize(("without", "sites"), [(20.0, ["loss", "lid"]), (90.0, ["loss", "lid"]), (150.0, ["loss"])])
def test_an_event_beside_another_effect_explains_what_nothing_else_does(without: float, sites: list[str]) -> None:
    """A lid of which a store draws a tenth; and a wall's store, of which two long pulses draw the rest."""
    store, lid = replace(lag("loss"), kind="store", driver="air"), event("lid", (250.0, 200.0))
    said = told(Given((store, lid), 500.0, 0.9), Given((store,), without, 0.4), Given((lid,), 300.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


def test_an_event_that_explains_most_alone_is_not_given_up_for_what_another_effect_draws_of_it() -> None:
    """A condenser that fouls, of which a dependence on the flow draws a third and adds a tenth."""
    law, fouls = replace(lag("transfer"), kind="depends", driver="flow"), event("condenser", (250.0, 1e7))
    said = told(Given((law, fouls), 500.0, 0.9), Given((law,), 150.0, 0.3), Given((fouls,), 450.0, 0.8))
    assert said.word == "named" and [h.site for h in said.certain] == ["condenser"]


@pytest.mark.parametrize(("kind", "sites"), [("depends", ["law", "blower"]), ("gain", ["law"])])
def test_since_a_reference_a_law_of_the_plant_takes_no_event_that_explains_more(kind: str, sites: list[str]) -> None:
    """A blower that stays where it is for some hours, of which a law draws a fifth. A gain may well have changed."""
    law, stays = replace(lag("law"), kind=kind, driver="feed"), event("blower", (250.0, 200.0))  # type: ignore[arg-type]
    found = Given((law, stays), 500.0, 0.9), Given((law,), 105.0, 0.3), Given((stays,), 340.0, 0.8)
    assert [h.site for h in told(*found, since_reference=True).certain] == sites
    assert [h.site for h in told(*found).certain] == ["law"]


@pytest.mark.parametrize(
    ("alone", "apart", "said"),
    [(300.0, True, "leak switch with heater depends"), (300.0, False, "leak switch explains"), (90.0, False, "")],
)
def test_nothing_else_is_told_where_what_was_given_up_explains_more(
    alone: float, apart: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A leak for a while, of which a dependence takes a part: the pump was named, for an event of less worth."""
    leak, law = event("leak", (250.0, 400.0)), replace(lag("heater"), driver="heat", kind="depends")
    both, other = Given((leak, law), 500.0, 0.9), Given((event("pump", (250.0, 1e7)),), 200.0, 0.8)
    monkeypatch.setattr(
        judging, "told_apart", lambda search, base, best, e: best is not e and not (e is other and not apart)
    )
    found = told(both, Given((law,), 150.0, 0.4), Given((leak,), alone, 0.9), other)
    assert found.word == ("abstain" if said else "named") and said in found.why


@pytest.mark.parametrize(("lasts", "sites"), [(1e7, ["damping", "gyro"]), (600.0, ["damping"])])
def test_an_event_that_stays_is_not_drawn_by_what_explains_something_else(lasts: float, sites: list[str]) -> None:
    """Each has as much alone as beside the other. What comes and goes may still be what a wrong law leaves."""
    gyro, law = event("gyro", (250.0, lasts)), replace(lag("damping"), kind="depends", driver="speed")
    said = told(Given((law, gyro), 1000.0, 0.9), Given((law,), 430.0, 0.4), Given((gyro,), 560.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


@pytest.mark.parametrize(("where", "sites"), [("feed", ["feed", "feed"]), ("valve", ["valve"])])
def test_an_event_beside_a_constant_error_of_its_site_is_a_level_before_and_after(where: str, sites: list[str]) -> None:
    """A feed was 7 % richer than its recipe, and 12 % more from some time on: the constant draws half of that."""
    off, richer = shift(where), event("feed", (250.0, 1e7))
    said = told(Given((off, richer), 1000.0, 0.9), Given((off,), 550.0, 0.4), Given((richer,), 600.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


@pytest.mark.parametrize(("times", "sites"), [(AT_STEPS, ["valve"]), (BETWEEN, ["valve", "sensor"])])
def test_an_event_at_the_steps_of_an_input_is_none(times: tuple[tuple[float, float], ...], sites: list[str]) -> None:
    """It follows the input, so it takes up what is wrong with the model there; what is beside it is told."""
    valve, shift = lag("valve"), event("sensor", *times)
    said = told(Given((valve, shift), 500.0, 0.9), Given((valve,), 80.0, 0.5), Given((shift,), 200.0, 0.3))
    assert said.word == "named"
    assert [h.site for h in said.certain] == sites


def test_an_event_alone_may_come_with_an_input() -> None:
    """Guests come when those who are counted go."""
    assert told(Given((event("sensor", *AT_STEPS),), 500.0, 0.9)).word == "named"


def test_why_nothing_is_told_says_that_an_event_follows_an_input() -> None:
    valve, shift = lag("valve"), event("sensor", *AT_STEPS)
    said = told(Given((valve, shift), 500.0, 0.9), Given((valve,), 300.0, -0.5), Given((shift,), 200.0, -0.3))
    assert said.word == "abstain"
    assert "sensor switch: at steps of an input, so it is no event" in said.why and "valve lag predicts" in said.why
