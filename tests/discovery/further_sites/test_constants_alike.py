"""Protects: a constant fault without a reference is told beside the fixed constant that would do the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from adaptive_flot.discovery.further_sites.same_meaning import constants_alike
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from tests.discovery.hypotheses.tank import tank


def fixed() -> Model:
    """The tank, its constants from a data sheet."""
    model = tank()
    return replace(model, parameters=tuple(replace(q, role="fixed") for q in model.parameters))


@pytest.mark.parametrize(
    ("site", "constants"), [("heater", ["efficiency"]), ("heat_loss", ["loss"]), ("thermometer", [])]
)
def test_a_gain_is_what_a_constant_that_is_off_does(site: str, constants: list[str]) -> None:
    """A heater that gives 5 % more, and an efficiency that is 5 % higher: the equations have their product only."""
    effect = Effect(site, "constant", "shift", {"amplitude": 0.05})
    assert [q.name for q in constants_alike(fixed(), effect)] == constants


def test_a_constant_that_is_fitted_has_no_note() -> None:
    assert constants_alike(tank(), Effect("heater", "constant", "shift", {"amplitude": 0.05})) == ()


def test_what_begins_at_a_time_is_no_constant_of_a_data_sheet() -> None:
    event = Effect("heater", "time", "step", {"amplitude": 0.05, "onset": 100.0})
    assert constants_alike(fixed(), event) == ()
