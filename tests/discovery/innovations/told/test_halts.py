"""A heater that stays at one power for a time, whatever it is asked, is told with its power and its times."""

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
