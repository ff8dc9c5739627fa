"""Protects from what wanders told as a switch: enough spells of the right lengths draw any course.

Forces on a healthy slide that wander were told as "1.44 N more while something is switched", in eight spells. Here it
is the mass of `test_turns`, pushed in ways that are known.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.events.at_times import times_of_switch
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.search.walking import comes_again, gain_of_a_walk, told_once
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.rivals import unless_it_wanders
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.innovations.told.test_turns import DAMPING, DT, GAIN, NOISE, ROWS, STEPS, STIFFNESS, mass

Spells = tuple[tuple[float, float], ...]
PUSH = 8.0
"""Size of a push over the mass [mm/s2]."""
LEANT_ON: Spells = ((3.0, 2.0), (8.0, 1.0), (13.0, 3.0), (20.0, 2.0), (28.0, 2.5))
STAYS: Spells = ((10.0, 4.0), (15.0, 6.0), (23.0, FOREVER))
"""Spells in which someone leans on the mass, and those in which a push that stays from 10 s on was told."""
TIME = DT * np.arange(ROWS, dtype=float)


def switched(spells: Spells) -> Hypothesis:
    settings = {"count": float(len(spells)), "width": 0.5 * DT}
    effect = Effect("coil", "time", "switch", times_of_switch(spells), settings, mode="offset")
    return Hypothesis("coil", "time", "switch", effect, ("amplitude",), ({},))


def inside(spells: Spells) -> FloatArray:
    return np.array([any(a <= t < a + long for a, long in spells) for t in TIME.tolist()], dtype=float)


def wandering(tau: float = 2.0) -> FloatArray:
    """An Ornstein-Uhlenbeck course of a standard deviation of 1 (N,); `tau` is its correlation time [s]."""
    rng, keep = np.random.default_rng(5), np.exp(-DT / tau)
    course = np.zeros(ROWS)
    for k in range(1, ROWS):
        course[k] = keep * course[k - 1] + np.sqrt(1 - keep**2) * rng.standard_normal()
    return course


def pushed(push: FloatArray) -> Dataset:
    rng = np.random.default_rng(12)
    volts = np.repeat(rng.uniform(-3.0, 3.0, ROWS // 20), 20)
    x, v, h, seen = 0.0, 0.0, DT / STEPS, np.zeros(ROWS)
    for k in range(1, ROWS):
        for _ in range(STEPS):
            v += h * (GAIN * volts[k] + push[k] - STIFFNESS * x - DAMPING * v)
            x += h * v
        seen[k] = x
    return Dataset("mass", TIME, DT, volts[:, None], (seen + NOISE * rng.standard_normal(ROWS))[:, None])


@cache
def case(kind: str) -> tuple[Search, Explanation, Explanation]:
    """A search on a record of one kind, the model as it is, and what a switch explains of it."""
    push, spells = PUSH * inside(LEANT_ON), LEANT_ON
    if kind == "wanders":
        course = wandering()
        push = PUSH / 2 * course
        marks = [0, *(np.flatnonzero(np.diff(np.sign(course))) + 1).tolist(), ROWS - 1]
        found = [(a, b) for a, b in pairwise(marks) if course[(a + b) // 2] > 0 and b - a > 10]
        spells = tuple((float(TIME[a]), float(TIME[b] - TIME[a])) for a, b in found)
    elif kind == "stays":
        push, spells = PUSH * inside(((10.0, FOREVER),)), STAYS
    model, data = mass(), pushed(push)
    search = Search(model, data, (0,), noise_floor([data], (0,)), ("stiffness", "damping"))
    h = switched(spells)
    with np.errstate(all="ignore"):
        base = search.base(model.parameter_values)
        extended = model_with(model, h)
        p = extended.parameter_values
        p[extended.index("parameters", h.parameters[0])] = PUSH
        return search, base, search.added(base, h, p)


def test_an_event_that_comes_again_has_three_spells() -> None:
    assert comes_again(switched(LEANT_ON)) and comes_again(switched(LEANT_ON[:3]))
    assert not comes_again(switched(LEANT_ON[:2]))


@pytest.mark.parametrize(("kind", "alike"), [("wanders", True), ("switched", False)])
def test_a_walk_explains_what_wanders_and_not_what_is_switched(kind: str, alike: bool) -> None:
    search, base, told = case(kind)
    gain = told.criterion - base.criterion
    assert gain > 50, "the spells explain much: else this asks nothing"
    assert (gain_of_a_walk(search, told, base, told.hypotheses[0]) > gain - LEAST_GAIN) == alike


@pytest.mark.parametrize(("kind", "word"), [("wanders", "abstain"), ("switched", "named")])
def test_what_wanders_is_not_told_as_switched_again_and_again(kind: str, word: str) -> None:
    search, base, told = case(kind)
    with np.errstate(all="ignore"):
        found = unless_it_wanders(search, base, Told("named", told, told.hypotheses, (), (told,), ""))
    assert found.word == word, found.why
    assert ("as what wanders does" in found.why) == (kind == "wanders")


def test_a_change_that_stays_and_was_told_in_parts_is_told_once() -> None:
    """Dry friction that grew once was told as larger "while something is switched", in eight spells."""
    search, base, told = case("stays")
    with np.errstate(all="ignore"):
        once = told_once(search, told, base, told.hypotheses[0])
    assert once is not None
    assert once.hypotheses[0].pulses == ((10.0, FOREVER),)
    assert once.criterion > told.criterion, "here the pauses were put in by hand"
    assert search.coefficient(once, once.hypotheses[0], "amplitude") == pytest.approx(PUSH, rel=0.1)
