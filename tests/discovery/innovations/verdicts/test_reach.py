"""Outputs that an effect can change: those that a sensor shows, all behind what a state depends on."""

import pytest

from adaptive_flot.discovery.innovations.verdicts.reach import outputs_in_reach
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from benchmarks.other_processes.plants import two_tanks


@pytest.fixture(scope="module")
def tanks() -> Model:
    return two_tanks.make_model()


@pytest.mark.parametrize(
    ("effects", "outputs"),
    [
        ([Effect("lower_gauge", "constant", "shift")], ("lower",)),
        ([Effect("lower_gauge", "lag", "lag", {"amplitude": 1.0}, {"scale": 1.0})], ("lower",)),
        ([Effect("upper_gauge", "constant", "shift"), Effect("lower_gauge", "constant", "shift")], ("upper", "lower")),
        ([Effect("pump", "constant", "shift")], ("upper", "lower")),
        ([Effect("lower_outlet", "constant", "shift")], ("lower",)),  # nothing flows back into the upper one
        ([], ()),
    ],
)
def test_outputs_behind_effects(tanks: Model, effects: list[Effect], outputs: tuple[str, ...]) -> None:
    assert outputs_in_reach(tanks, tanks.with_effects(effects)) == outputs


def test_effects_that_both_have_do_not_count(tanks: Model) -> None:
    before = tanks.with_effects([Effect("pump", "constant", "shift")])
    after = before.with_effects([Effect("lower_gauge", "constant", "shift")])
    assert outputs_in_reach(before, after) == ("lower",)
