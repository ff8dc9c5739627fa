"""Protects names of a free run beside exact twins: one of two effects that does the same at another site."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations.places.free_run import or_the_part_itself, with_twins
from adaptive_flot.discovery.results import Alternative, Judgement
from adaptive_flot.greybox.effects import Effect, Mode
from benchmarks.other_processes.plants.dosing import make_model as basin
from tests.discovery.whole_records.test_hardening_spring import oscillator

KNOTS = {"knots": (-0.1, 0.1)}
BENT = Effect("damper", "position", "curve", settings=KNOTS, mode="offset")
GAUGE = Effect("sensor", "position", "curve", settings=KNOTS, mode="offset")
LATE = Effect("sensor", "lag", "lag", settings={"scale": 0.1})


def told(*effects: Effect) -> Judgement:
    """A name of some effects at an oscillator, beside its twins."""
    model = oscillator().with_effects(list(effects))
    fit: Any = SimpleNamespace(model=model, bic=0.0)
    names = tuple((e.site, e.driver) for e in effects)
    best = Alternative(names, (True,) * len(names), fit, 100.0, -100.0)
    return with_twins(oscillator(), Judgement("named", best, (), (), 10.0))


def test_a_damper_that_depends_on_the_position_may_be_the_spring() -> None:
    """Forces add up. A late sensor beside it depends on something else, and stays in each set."""
    found = told(BENT, LATE)
    assert found.word == "class" and not found.part
    assert found.members == (("damper", "position"), ("sensor", "lag"), ("spring", "position"))
    assert [a.names for a in found.rivals] == [(("spring", "position"), ("sensor", "lag"))]


def test_what_depends_on_the_same_beside_it_is_not_told() -> None:
    """A cubic spring was told as the damper, and a gauge that shows 0.24 % more above zero than below."""
    found = told(BENT, GAUGE)
    assert found.word == "class" and found.part == (("damper", "position"),)
    assert found.members == (("damper", "position"), ("spring", "position"))


@pytest.mark.parametrize("effects", [(BENT,), (LATE, GAUGE)])
def test_one_effect_has_been_searched_at_all_sites_and_a_sensor_has_no_twin(effects: tuple[Effect, ...]) -> None:
    assert told(*effects).word == "named"


@pytest.mark.parametrize(("site", "driver", "is_class"), [
    ("demand", "dose", True), ("demand", "flow", False), ("decay", "dose", False), ("doser", "own_value", False),
])  # fmt: skip
def test_what_depends_on_what_is_asked_of_an_actuator_may_be_the_actuator(
    site: str, driver: str, is_class: bool
) -> None:
    """A doser at its limit was told as a demand of the water that grows with the dose: both enter one balance."""
    form = "saturation" if driver == "own_value" else "curve"
    mode: Mode | None = None if driver == "own_value" else "offset" if site == "demand" else "factor"
    settings = {"width": 0.1} if driver == "own_value" else {"knots": (10.0, 60.0)}
    effect = Effect(site, "saturation" if driver == "own_value" else driver, form, settings=settings, mode=mode)
    fit: Any = SimpleNamespace(model=basin().with_effects([effect]), bic=0.0)
    best = Alternative(((effect.site, effect.driver),), (True,), fit, 100.0, -100.0)
    found = or_the_part_itself(basin(), Judgement("named", best, (), (), 10.0))
    assert found.word == ("class" if is_class else "named")
    assert found.members == ((("demand", "dose"), ("doser", "own_value")) if is_class else ())
