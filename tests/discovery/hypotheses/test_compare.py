"""Protects: what has changed since a reference record, on a heated tank; and that nothing is told where nothing is."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.greybox import Effect
from tests.discovery.hypotheses.tank import COLDER, DRAUGHT, LEAKS, NOISE, ROWS, STUCK, record, tank

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


@pytest.mark.parametrize("seed", [1, 4])
def test_a_record_that_starts_far_from_the_first_guess_has_not_changed(seed: int) -> None:
    """Where it starts says nothing of the constants, and the reference says nothing of where it starts."""
    verdict = compare(tank(), [record("new", seed, start=380.0)], [record("old", 2)]).verdict
    assert verdict.word == "none", verdict.reason


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


def test_a_sensor_that_has_stopped_is_told_beside_a_part_that_would_do_the_same() -> None:
    """A heater that stays where it is holds a tank at rest just as still; but no noise at all is a note of its own."""
    new = record("new", 1)
    frozen = replace(new, outputs=np.full_like(new.outputs, 303.0))
    verdict = compare(tank(), [frozen], [record("old", 2)]).verdict
    assert verdict.word == "class" and ("thermometer", "own_value") in verdict.members
    assert "new: temperature shows the same value in 500 rows on end; its sensor may have stopped." in verdict.notes


@pytest.mark.parametrize(("rows", "reference"), [(20, ROWS), (ROWS, 20), (3, 3)])
def test_a_few_rows_say_nothing(rows: int, reference: int) -> None:
    new, old = record("new", 1, DRAUGHT).rows(0, rows), record("old", 2).rows(0, reference)
    verdict = compare(tank(), [new], [old]).verdict
    assert verdict.word == "insufficient" and "60 of each are needed" in verdict.reason


def test_missing_values_and_spikes_give_no_other_name() -> None:
    """A third of the values is gone: the same verdict. With a spike in every 37th row: the same, or none."""
    new = record("new", 1, DRAUGHT)
    gone = np.where(np.random.default_rng(0).random(new.outputs.shape) < 0.3, np.nan, new.outputs)
    spiked = new.outputs.copy()
    spiked[::37] += 50.0
    for outputs, words in ((gone, {"named"}), (spiked, {"named", "abstain"})):
        verdict = compare(tank(), [replace(new, outputs=outputs)], [record("old", 2)]).verdict
        assert verdict.word in words
        assert all(e.effect.site == "heat_loss" for e in verdict.effects)


def test_a_noisier_thermometer_is_no_change() -> None:
    """Its errors are 1.8 times those of the reference, and all of them noise from row to row."""
    new, rng = record("new", 1), np.random.default_rng(5)
    noisier = replace(new, outputs=new.outputs + np.sqrt(1.8**2 - 1) * NOISE * rng.normal(size=new.outputs.shape))
    verdict = compare(tank(), [noisier], [record("old", 2)]).verdict
    assert verdict.word == "none" and "noise from row to row" in verdict.reason, verdict.reason


def test_a_part_at_rest_for_most_of_the_time_may_give_less() -> None:
    """A pump that ran for a third of the time had no such hypothesis: its limit was told instead."""
    weak = Effect("heater", "constant", "shift", {"amplitude": np.log(0.75)}, mode="factor")
    found = compare(tank(), [record("new", 3, weak, rests=0.6)], [record("old", 2, rests=0.6)])
    assert "heater gain" in {t.hypothesis.label for t in found.tested if t.hypothesis is not None}
    assert found.verdict.word in ("named", "class")
    assert "heater is 25 % smaller" in found.verdict.reason.lower()


@pytest.mark.parametrize(
    ("value", "size"),
    [([0.0] * 6 + [2.0, 3.0, 4.0], 3.0), ([1.0, 2.0, 3.0], 2.0), ([0.0] * 4, 0.0), ([-5.0, 0.0, 0.0, 0.0], 5.0)],
)
def test_the_ordinary_size_of_a_value_is_that_of_the_rows_in_which_it_does_something(
    value: list[float], size: float
) -> None:
    assert ordinary_size(np.array(value)) == size
    assert np.isnan(ordinary_size(np.array([np.nan, 1.0])))
