"""Protects: what is said of a dependence agrees with whether it may be named."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.candidates.catalogue import has_a_reason
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.discovery.results.words import DRIFTS, NO_SITE
from adaptive_flot.discovery.verdict import conclude
from adaptive_flot.discovery.verdict.conclude import _meaning
from adaptive_flot.discovery.verdict.words import wording
from adaptive_flot.greybox import Effect
from adaptive_flot.report.discovery.answer import title_of
from adaptive_flot.report.discovery.page import TITLES
from tests.discovery.hypotheses.test_constants import tank


@pytest.mark.parametrize(
    ("site", "driver", "named"),
    [
        ("heater", "duty", True),
        ("heater", "room", False),
        ("heater", "temperature", False),
        ("thermometer", "temperature", True),
        ("thermometer", "duty", False),
        ("thermometer", "time", True),
        ("loss", "room", True),
    ],
)
def test_an_actuator_may_depend_on_its_command_and_a_sensor_on_what_it_measures(
    site: str, driver: str, named: bool
) -> None:
    """A reboiler that bends over its own steam was `named`, and "without a name" in the same sentence."""
    model = tank()
    its_site = next(s for s in model.sites if s.name == site)
    assert has_a_reason(model, its_site, driver) == named
    said = _meaning(model, Effect(site, driver, "curve", {"value_1": 0.0, "value_2": 0.1}, {"knots": (0.0, 1.0)}))
    assert ("without a name" in said) == (not named)


def test_what_comes_as_near_elsewhere_is_not_said_to_be_at_the_same_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured: an engine's filling or its speed pickup depends on speed, "at the same places: pressure sensor"."""
    monkeypatch.setattr(wording, "words_alone", lambda a: " depends on ".join(a.names[0]))
    sets = [SimpleNamespace(names=(name,)) for name in [("filling", "speed"), ("gauge", "speed"), ("filling", "flow")]]
    judged: Any = SimpleNamespace(
        best=sets[0], rivals=sets[1:], near=lambda a: True, part=(), beside="", members=(("filling", "speed"),)
    )
    said = wording._class_words(judged, ())
    assert "At the same places it may as well be: filling by flow." in said
    assert "As near, but without a known reason: gauge by speed." in said


@pytest.mark.parametrize(
    ("site", "driver", "referred", "said"),
    [
        ("thermometer", "lag", False, True),
        ("thermometer", "delay", False, True),
        ("thermometer", "lag", True, False),
        ("thermometer", "time", False, False),
        ("heater", "lag", False, False),
    ],
)
def test_a_late_sensor_is_said_to_look_like_a_store_before_it(
    site: str, driver: str, referred: bool, said: bool
) -> None:
    """Measured: a healthy wall, whose model has five lumps, was told as a thermometer that answers late."""
    judged = SimpleNamespace(word="named", best=SimpleNamespace(names=((site, driver),)), part=(), members=())
    state: Any = SimpleNamespace(referred=referred, judged=judged, model=tank())
    assert bool(conclude._looks_like_a_store(state)) == said


@pytest.mark.parametrize(
    ("word", "reason", "title"),
    [
        ("abstain", f"Something is missing. It is as if level lost a share of itself: {NO_SITE}.", "no site"),
        ("abstain", f"Something differs from the reference, as if level lost a share of itself: {NO_SITE}.", "no site"),
        ("abstain", f"No change is told: it may be. The nearest: pump; or as if air were less, and {NO_SITE}.", "what"),
        ("abstain", "Something is missing, but the record does not say what.", "does not tell what"),
        ("abstain", f"{DRIFTS} What explains it best: heater changes by about -24 %.", "changes with time"),
        ("class", f"One of these: pump; or as if something takes from the balance of level, and {NO_SITE}.", "a few"),
    ],
)
def test_the_title_of_an_abstention_says_where_the_model_lacks_a_site(word: Any, reason: str, title: str) -> None:
    assert title in title_of(Verdict(word, reason), TITLES)


@pytest.mark.parametrize(("word", "first"), [("abstain", True), ("class", False)])
def test_an_abstention_begins_with_what_acts_without_a_site_and_a_class_has_it_as_a_note(
    word: str, first: bool
) -> None:
    state: Any = SimpleNamespace(without_a_site="as if water came", judged=SimpleNamespace(word=word))
    assert conclude._acts_without_a_site(state) == first
    assert bool(conclude._beside(state)) != first
    assert conclude._rest("Something is missing, but it is not told: pump by time fits best.").startswith(
        "pump by time"
    )
    assert conclude._rest("Something is missing, and no effect explains it.").startswith("Something is missing")
