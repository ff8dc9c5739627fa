"""Protects: what has changed since a reference record, on a heated tank; and that nothing is told where nothing is."""

from __future__ import annotations

from functools import cache

import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from tests.discovery.hypotheses.tank import COLDER, DRAUGHT, LEAKS, STUCK, record, tank

EFFECTS = {"stuck": (STUCK,), "leaks": (LEAKS,), "colder": (COLDER,), "draught": (DRAUGHT,), "none": ()}


@cache
def told(change: str = "none", zero: float = 0.0) -> Comparison:
    """Whether the change is found, in a record with it beside one without."""
    effects = EFFECTS[change]
    new, old = (record(n, s, *e, zero=zero) for n, s, e in (("new", 1, effects), ("old", 2, ())))
    return compare(tank(zero), [new], [old])


def test_constants_come_from_the_reference() -> None:
    """They are those of the plant, though the model came with others."""
    fitted = told().calibration.model
    assert fitted.parameter_values == pytest.approx([0.9, 80.0], rel=0.03)


def test_nothing_is_told_where_nothing_has_changed() -> None:
    assert told().verdict.word == "none"


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("stuck", {"heater"}),
        ("leaks", {"heater"}),
        ("draught", {"heat_loss"}),
        # with a loss that is proportional to the temperature, 3 K at the thermometer are 240 W at the heater
        ("colder", {"thermometer", "heater"}),
    ],
)
def test_the_part_that_has_changed_is_named_or_in_a_class_of_what_is_the_same(change: str, parts: set[str]) -> None:
    """Each kind of change is told, no part that is well is named, and the error falls on rows that did not fit it."""
    verdict = told(change).verdict
    assert verdict.word == ("named" if len(parts) == 1 else "class")
    assert ({s for s, _ in verdict.members} or {verdict.effects[0].effect.site}) == parts
    assert verdict.error[0].after < 0.5 * verdict.error[0].before


def test_size_is_that_of_the_plant() -> None:
    """A leak of 700 W is told as one of 700 W, give or take a tenth."""
    best = told("leaks").judged.best
    assert best is not None and best.hypothesis is not None
    assert best.hypothesis.kind == "leaks"
    assert best.fit.value(best.hypothesis.parameters[0]) == pytest.approx(700.0, rel=0.1)


@pytest.mark.parametrize("change", ["stuck", "colder"])
def test_the_verdict_does_not_depend_on_the_zero_of_the_scale(change: str) -> None:
    """Kelvin or degrees Celsius: the same word, the same parts, the same sizes."""
    kelvin, celsius = (told(change, zero).verdict for zero in (0.0, 273.15))
    assert (kelvin.word, kelvin.members) == (celsius.word, celsius.members)
    for one, other in zip(kelvin.effects, celsius.effects, strict=True):
        assert one.effect.site == other.effect.site and one.effect.form == other.effect.form
        for name, value in one.effect.coefficients.items():
            assert other.effect.coefficients[name] == pytest.approx(value, rel=0.01)


def test_records_have_an_initial_state_each() -> None:
    """Two records that start 30 K apart are fitted together, and nothing is carried across their border."""
    warm, cold = record("warm", 3, start=330.0), record("cold", 4, start=300.0)
    calibration = compare(tank(), [warm, cold]).calibration
    assert [float(x[0]) for x in calibration.fit.initial] == pytest.approx([330.0, 300.0], abs=0.5)
    assert calibration.model.parameter_values == pytest.approx([0.9, 80.0], rel=0.03)
