"""Families of the innovations form, each on a plate with a Peltier element: a process that is not flotation."""

import re

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.courses import suspects
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.places.row_by_row import _period
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from tests.discovery.innovations.thermostat import BAND, DT, FOR, LAMP, ON, PERIOD, SWING, ZONE, Wrong, model, record


def _told(wrong: Wrong) -> tuple[Told, str, Search]:
    """What is told, and in words."""
    data, plain = record(wrong), model()
    search = Search(plain, data, (0,), noise_floor([data], (0,)), ("conductance", "capacity"))
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        told = judge(search, base, best_explanations(search, base))
    return told, told_in_words(search, told), search


def _values(search: Search, told: Told, site: str) -> dict[str, float]:
    """Coefficients of the effect at a site, in the best explanation that has one there."""
    best = next(e for e in told.alike if e.hypotheses[0].site == site)
    fitted, h = search.model_of(best), best.hypotheses[0]
    return {
        c: fitted.parameters[fitted.index("parameters", n)].value for c, n in zip(h.free, h.parameters, strict=True)
    }


def test_an_element_with_play_is_told_with_its_size() -> None:
    told, words, search = _told("hysteresis")
    assert [(h.site, h.kind) for h in told.certain] == [("element", "hysteresis")], (told.word, words)
    values = _values(search, told, "element")
    assert values.get("rest", values["band"]) == pytest.approx(BAND, rel=0.05)
    assert "Element has play: it stays up to" in words


def test_an_element_that_idles_about_zero_is_told_with_its_zone() -> None:
    told, words, search = _told("dead zone")
    assert [(h.site, h.kind) for h in told.certain] == [("element", "dead zone")], (told.word, words)
    assert _values(search, told, "element")["half_width"] == pytest.approx(ZONE, rel=0.15)
    assert "does not move within" in words


def test_a_disturbance_that_comes_and_goes_is_told_with_its_period() -> None:
    """Once it has settled, a sine of heat is a sine at the thermometer: the record can not tell the two apart."""
    told, words, search = _told("periodic")
    assert told.word in ("named", "class") and {h.kind for e in told.alike for h in e.hypotheses} == {"periodic"}, words
    values = _values(search, told, "other_heat")
    assert values["period"] == pytest.approx(PERIOD, rel=0.02)
    assert np.hypot(values["sine"], values["cosine"]) == pytest.approx(SWING, rel=0.1)


def test_a_lamp_with_a_clock_is_told_with_its_times() -> None:
    """Of a house that is aired every night, a wave was told, and a second effect for what a wave leaves."""
    told, words, search = _told("cycle")
    assert told.word in ("named", "class"), words
    (lamp,) = (h for h in told.effects if h.site == "other_heat")
    assert lamp.kind == "cycle", words
    assert lamp.effect.coefficients["period"] == pytest.approx(PERIOD, rel=0.005)
    assert lamp.effect.coefficients["onset"] == pytest.approx(ON, abs=2 * DT)
    assert lamp.effect.coefficients["duration"] == pytest.approx(FOR, abs=3 * DT)
    assert _values(search, told, "other_heat")["amplitude"] == pytest.approx(LAMP, rel=0.15)
    assert _period(search, told.best, told.best.hypotheses[0]) == lamp.effect.coefficients["period"]
    assert re.search(r"W more for 2\d\d s of every (699|70\d) s, first at 1\d\d-3\d\d s", words), words


def test_a_constant_heat_where_the_model_has_none_is_told_with_its_size() -> None:
    """The model's other heat is 0 W: what enters a balance is not limited by what has been seen of it.

    An element that gives as much too much is the same record, and so is a loss that is as much smaller.
    """
    told, words, search = _told("lamp")
    assert told.word in ("named", "class"), words
    assert "other_heat" in {h.site for h in told.effects} and {h.driver for h in told.effects} == {"constant"}, words
    assert _values(search, told, "other_heat")["amplitude"] == pytest.approx(LAMP, rel=0.15)


def test_nothing_is_told_of_a_plate_that_does_as_it_is_told() -> None:
    assert _told("nothing")[0].word == "none"


def test_a_feed_and_an_instrument_are_not_tried_to_depend_on_what_they_have_no_reason_for() -> None:
    """A reaction of second order was told as a feed that depends on the concentration in the reactor."""

    def equations(m: Scope) -> None:
        salt = m.state("salt")
        feed = m.site("feed", m.input("feed"), "feed")
        rate = m.site("rate", m.parameter("rate"), "process")
        m.derivative("salt", (feed - salt) / 100.0 - rate * salt)
        m.output("probe", m.site("probe", salt, "sensor"))

    reactor = Model(
        name="reactor",
        states=(Quantity("salt", "g/L", ""),),
        inputs=(Quantity("feed", "g/L", ""), Quantity("room", "degC", "")),
        parameters=(Parameter("rate", 0.01, "1/s", ""),),
        outputs=(Quantity("probe", "g/L", ""),),
        equations=equations,
        max_step_s=10.0,
    )
    seen = np.linspace(1.0, 2.0, 50)
    found = suspects(reactor, dict.fromkeys(("feed", "rate", "probe"), seen), {"salt": seen, "room": seen}, 10.0)
    depend = {(s.hypothesis.site, s.hypothesis.driver) for s in found if s.hypothesis.kind == "depends"}
    assert depend == {("rate", "salt"), ("rate", "room")}
