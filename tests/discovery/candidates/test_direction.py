"""A cause has a sign: what goes the other way does not get its name."""

from __future__ import annotations

from dataclasses import replace

import pytest

from adaptive_flot.discovery.candidates.direction import against, nameable, trend
from adaptive_flot.discovery.discover import discover
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.quantities import KnownEffect
from tests.discovery.heated import Truth, heated_tank, tank_record

CURVE = {"knots": (5.0, 10.0, 15.0, 20.0)}


@pytest.mark.parametrize(
    ("effect", "sign"),
    [
        (Effect("heat_loss", "fan_speed", "power", {"amplitude": 5.0, "exponent": -0.2}, {"reference": 10.0}), -1),
        (Effect("heat_loss", "constant", "shift", {"amplitude": 0.3}), 1),
        (Effect("heat_loss", "fan_speed", "curve", {f"value_{k + 1}": 3.0 - k for k in range(4)}, CURVE), -1),
        (Effect("heat_loss", "fan_speed", "curve", {f"value_{k + 1}": 9.0 for k in range(4)}, CURVE), 0),
    ],
)
def test_the_trend_is_that_of_the_dependence_and_not_of_its_constant(effect: Effect, sign: int) -> None:
    assert trend(effect) == pytest.approx(0, abs=1e-9) if sign == 0 else trend(effect) * sign > 0


def test_only_a_quantity_of_the_process_may_go_the_other_way_under_its_own_name() -> None:
    known = tuple(
        KnownEffect(site, "fan_speed", "cooling", "rises") for site in ("heat_loss", "heating", "thermometer")
    )
    model = replace(heated_tank(), known_effects=known)
    for site, named in (("heat_loss", True), ("heating", False), ("thermometer", False)):
        falls, rises = (
            Effect(site, "fan_speed", "power", {"amplitude": 0.0, "exponent": e}, {"reference": 10.0}) for e in (-1, 1)
        )
        assert against(model, falls) and not against(model, rises)
        assert nameable(model, falls, True) is named
        assert nameable(model, rises, True) and not nameable(model, rises, False)


@pytest.mark.parametrize(("exponent", "said"), [(0.6, "draught"), (-0.6, "the other way than: draught")])
def test_the_verdict_tells_when_an_effect_goes_the_other_way(exponent: float, said: str) -> None:
    """A loss that falls with the fan is found as well, but it is no draught."""
    model = replace(heated_tank(), known_effects=(KnownEffect("heat_loss", "fan_speed", "draught", "rises"),))
    found = discover(model, tank_record(Truth(exponent=exponent))).verdict
    assert found.word == "named"
    assert [(e.effect.site, e.effect.driver, e.meaning) for e in found.effects] == [("heat_loss", "fan_speed", said)]
