"""The thirty mismatched plants are drawn once and for all, and none is the model's own."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.mismatched_plants.plants import WIDTHS, plant


def constants(scenario: Scenario) -> dict[str, float]:
    """Constants of the plant as multiples of the model's, where they differ."""
    own = {p.name: float(v) for p, v in zip(scenario.model.parameters, scenario.model.parameter_values, strict=True)}
    plants = zip(scenario.plant_model.parameters, scenario.plant_model.parameter_values, strict=True)
    return {p.name: float(v) / own[p.name] for p, v in plants if p.name in own and float(v) != own[p.name]}


def test_a_plant_has_the_numbers_of_its_first_draw(tmp_path: Path) -> None:
    """Plant 3, as the published loops had it: seeds were fixed before anything was tuned."""
    scenario = plant(3, tmp_path)
    drawn = yaml.safe_load((tmp_path / "plant_03.yaml").read_text(encoding="utf-8"))["plant"]
    power, lag = drawn["effects"]
    assert (power["site"], power["driver"]) == ("bubble_size", "air_flow")
    assert power["coefficients"]["exponent"] == pytest.approx(-0.28714571572968595, rel=1e-12)
    assert lag["coefficients"]["time_constant"]["value"] == pytest.approx(19.059629274790908, rel=1e-12)
    assert drawn["feed_walk"]["feed_flow_m3_s"]["share"] == pytest.approx(0.05899260697050927, rel=1e-12)
    assert 1 <= len(constants(scenario)) <= 5


@pytest.mark.parametrize("number", [0, 17, 29])
def test_constants_stay_within_their_widths_and_plants_differ(number: int, tmp_path: Path) -> None:
    found, other = constants(plant(number, tmp_path)), constants(plant((number + 1) % 30, tmp_path))
    assert found and found != other
    assert all(abs(ratio - 1) <= max(WIDTHS.values()) + 1e-12 for ratio in found.values())
