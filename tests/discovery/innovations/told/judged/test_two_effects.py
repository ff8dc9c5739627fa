"""Two effects often stand for a third thing; an event that stands by itself, and does not wander, is told."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import rivals
from tests.discovery.innovations.told.judged.given import Given, asked_again, event, lag, told


@pytest.mark.parametrize(("kind", "word"), [("offset", "abstain"), ("store", "named")])
def test_two_effects_by_name_are_rarer_than_a_third_thing_that_they_stand_in_for(kind: str, word: str) -> None:
    """But for a store, which most models leave out."""
    first = lag("sensor")
    other = replace(lag("valve"), kind=kind, driver="level")  # type: ignore[arg-type]
    said = told(Given((first, other), 500.0, 0.9), Given((first,), 300.0, 0.5), Given((other,), 250.0, 0.4))
    assert said.word == "named" and len(said.certain) == 2
    asked = asked_again(said)
    assert asked.word == word and "sensor" in asked.why + str(asked.certain)
    assert asked_again(told(Given((first,), 500.0, 1.0))).word == "named"


@pytest.mark.parametrize(
    ("long", "alone", "other", "sites"),
    [
        (1e7, 300.0, 200.0, ["gyro"]),
        (1e7, 240.0, 100.0, []),
        (200.0, 360.0, 140.0, ["gyro"]),
        (200.0, 340.0, 140.0, ["damping"]),
        (200.0, 360.0, 160.0, ["damping"]),
    ],
)
def test_an_event_that_has_most_of_the_gain_with_and_without_the_other_effect_stands_by_itself(
    long: float, alone: float, other: float, sites: list[str]
) -> None:
    """A gyro came to show more at a row, beside a law of the ship that is a little wrong: the gyro is told.

    Of what goes again more is asked: a bypass that was open for a time, beside a positioner with a little play.
    """
    gyro, law = event("gyro", (250.0, long)), replace(lag("damping"), kind="depends", driver="speed")
    found = Given((gyro, law), 500.0, 0.9), Given((gyro,), alone, 0.5), Given((law,), other, 0.4)
    said = told(*found)
    asked = asked_again(said, *found)
    assert asked.word == ("named" if sites else "abstain")
    assert [h.site for h in asked.certain] == sites


def test_two_stores_say_how_the_process_is_and_are_no_fault() -> None:
    """A gauge that slips was named as a store behind the inflow, and another one behind the outflow."""
    stores = [replace(lag(site), kind="store", driver="level") for site in ("inflow", "outflow")]
    said = told(Given(tuple(stores), 500.0, 0.9), *(Given((s,), 300.0, 0.5) for s in stores))
    assert said.word == "named" and asked_again(said).word == "abstain"


@pytest.mark.parametrize(("alone", "word"), [(False, "abstain"), (True, "class")])
def test_a_class_of_events_that_all_need_a_second_effect_is_not_told(alone: bool, word: str) -> None:
    """A motor's dry friction was seven pulses of its voltage or its load, with an offset or a dead zone beside them."""
    one, two, offset = event("amplifier", (25.0, 20.0)), event("load", (25.0, 20.0)), lag("sensor")
    first = (one,) if alone else (one, offset)
    best: Any = [Given(first, 500.0, 0.9), Given((two, offset), 498.0, 0.9)]
    said = Told("class", best[0], (), ((best[0], one), (best[1], two)), tuple(best), "")
    asked = asked_again(said)
    assert asked.word == word and (alone or "one of amplifier switch, load switch" in asked.why)


@pytest.mark.parametrize(("alone", "word", "sites"), [(450.0, "named", ["load"]), (200.0, "abstain", [])])
def test_an_event_with_one_of_a_class_beside_it_is_told_where_it_stands_by_itself(
    alone: float, word: str, sites: list[str]
) -> None:
    """Two effects are needed here, too, whichever the second one is: a healthy wall had a late thermometer so."""
    load, one, two = event("load", (250.0, 1e7)), lag("sensor"), lag("motor")
    best: Any = [Given((load, one), 600.0, 0.9), Given((load, two), 598.0, 0.9)]
    said = Told("class", best[0], (load,), ((best[0], one), (best[1], two)), tuple(best), "")
    asked = asked_again(said, *best, Given((load,), alone, 0.5), Given((one,), 100.0, 0.5))
    assert asked.word == word and [h.site for h in asked.effects] == sites
    assert word == "named" or "load switch and one of sensor lag, motor lag" in asked.why


@pytest.mark.parametrize(("again", "word"), [(0.0, "named"), (60.0, "named"), (90.0, "abstain")])
def test_an_event_at_a_site_that_changes_as_much_at_other_times_is_none(again: float, word: str) -> None:
    """The event gains 300; a fan's pressure that wanders gains 138 by its largest swing, and 64 by the next."""
    lid = event("lid", (250.0, 200.0))
    said = told(Given((lid,), 300.0, 0.9))
    search: Any = SimpleNamespace(switched_again=lambda explanation, h: again)
    asked = rivals.unless_it_wanders(search, Given((), 0.0, 0.0), said)  # type: ignore[arg-type]
    assert asked.word == word and (word == "named" or "it wanders" in asked.why)
    small = replace(said, best=Given((lid,), 40.0, 0.9))  # type: ignore[arg-type]
    assert rivals.unless_it_wanders(search, Given((), 0.0, 0.0), small).word == "abstain"  # type: ignore[arg-type]
    lasting = told(Given((lag("valve"),), 300.0, 0.9))
    assert rivals.unless_it_wanders(search, Given((), 0.0, 0.0), lasting) is lasting  # type: ignore[arg-type]


def test_a_store_and_a_dependence_are_not_told_by_name() -> None:
    """An outflow with another exponent was drawn by both."""
    store = replace(lag("inflow"), kind="store", driver="level")
    law = replace(lag("outflow"), kind="depends", driver="level")
    pair = Given((store, law), 500.0, 0.9)
    said = told(pair, Given((store,), 200.0, 0.4), Given((law,), 150.0, 0.3))
    assert said.word == "named" and asked_again(said).word == "abstain"
