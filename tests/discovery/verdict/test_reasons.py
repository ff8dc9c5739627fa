"""Protects: what is said of a dependence agrees with whether it may be named."""

from __future__ import annotations

import pytest

from adaptive_flot.discovery.candidates.catalogue import has_a_reason
from adaptive_flot.discovery.verdict.conclude import _meaning
from adaptive_flot.greybox import Effect
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
