"""A part that stays at one value for a time is told with it and its times: a heater, and a sensor that has stopped."""

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.since_reference.changes import find_changes
from tests.discovery.innovations.box import model, record

BEGINS, LEVEL = 1800.0, 45.0


@pytest.mark.parametrize("ends", [3000.0, 1e9])
def test_a_heater_that_is_stuck_from_some_time_on_is_told_since_a_reference(ends: float) -> None:
    new = record(lids=(), seed=3, stuck=(BEGINS, ends, LEVEL))
    verdict = find_changes(model(), [new], [record(lids=(), seed=7)]).verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.form) == ("heater", "stuck_while")
    c = told.effect.coefficients
    assert c["level"] == pytest.approx(LEVEL, abs=3.0)
    assert c["on_1"] == pytest.approx(BEGINS, abs=60.0)
    if ends < 1e9:
        assert c["on_1"] + c["for_1"] == pytest.approx(ends, abs=60.0)
    assert "stays at" in verdict.reason and "whatever is asked" in verdict.reason


def test_a_sensor_that_has_stopped_is_told_with_what_it_shows() -> None:
    """The filter follows it, so that no regression sees it: it is known by what it shows."""
    new = record(lids=(), seed=5)
    shown = new.outputs.copy()
    late = new.time >= BEGINS
    shown[late, 0] = 30.0 + 0.03 * np.random.default_rng(1).normal(size=int(late.sum()))
    verdict = find_changes(model(), [replace(new, outputs=shown)], [record(lids=(), seed=7)]).verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.form) == ("thermometer", "stuck_while")
    assert told.effect.coefficients["level"] == pytest.approx(30.0, abs=0.1)
    assert told.effect.coefficients["on_1"] == pytest.approx(BEGINS, abs=60.0)
    assert "shows 30 K and nothing else from" in verdict.reason
