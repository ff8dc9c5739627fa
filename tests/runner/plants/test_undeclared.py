"""A plant that differs from the model of estimator and controller: only the oracle knows; all figures still work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from tests.runner.conftest import WriteScenario

GROWTH = {
    "site": "bubble_size",
    "driver": "air_flow",
    "form": "power",
    "coefficients": {"exponent": 0.4},
    "settings": {"reference": {"value": 1.5e-3, "unit": "m3/s"}},
}
LATE_FEED = {
    "site": "feed_flow",
    "driver": "delay",
    "form": "delay",
    "coefficients": {"amplitude": 1.0, "dead_time": {"value": 20.0, "unit": "s"}},
    "settings": {"scale": {"value": 1.67e-4, "unit": "m3/s"}, "stages": 3},
}
OFFSET = {"site": "grade_sensor", "driver": "constant", "form": "shift", "coefficients": {"amplitude": 0.02}}
ORACLE = {"estimators.oracle": {"use": "oracle", "start": "nominal"}, "seeds": [1]}
EXPONENT = "bubble_size_by_air_flow.exponent"


def runs(write: WriteScenario, changes: dict[str, Any]) -> dict[str, Run]:
    return {run.estimator: run for run in run_scenario(load_scenario(write({**ORACLE, **changes})))}


def error(run: Run) -> float:
    late = run.table[run.table["time_s"] > 60]
    return float(np.abs(late["concentrate_grade_true"] - late["concentrate_grade_predicted"]).max())


def test_only_the_oracle_knows_the_plants_effects(write_scenario: WriteScenario) -> None:
    """A power law and a delay with states that the model lacks: the oracle predicts the plant, the others do not."""
    feed = {"profile": "steps", "at_s": [0, 60], "values": [1.67e-4, 1.9e-4]}
    found = runs(write_scenario, {"plant": {"effects": [GROWTH, LATE_FEED]}, "inputs.feed_flow_m3_s": feed})
    assert error(found["oracle"]) < 1e-9
    assert error(found["fixed"]) > 1e-3
    assert found["oracle"].fit["n"] == found["oracle"].fit["C"] == 100.0
    for run in found.values():
        assert np.isfinite(list(run.fit.values())).all()
        np.testing.assert_array_equal(run.table["C_true"], found["oracle"].table["C_true"])


def test_a_declared_effect_is_no_difference(write_scenario: WriteScenario, model: Model, tmp_path: Path) -> None:
    """The same effect in the scenario, in a model file, and in the plant explicitly: the same run to the bit."""
    growth = Effect("bubble_size", "air_flow", "power", {"exponent": 0.4}, {"reference": 1.5e-3})
    save_model(model.with_effects([growth]), tmp_path / "extended.yaml")
    one = runs(write_scenario, {"effects": [GROWTH]})
    two = runs(write_scenario, {"model": "extended.yaml"})
    three = runs(write_scenario, {"model": "extended.yaml", "plant": {"effects": [GROWTH]}})
    for name in one:
        for other in (two, three):
            pd.testing.assert_frame_equal(one[name].table, other[name].table, check_exact=True)


def test_a_plant_without_the_models_effect(write_scenario: WriteScenario) -> None:
    """The model believes in an effect and adapts its size; the plant has none, so the size has no truth and no fit."""
    changes = {"effects": [GROWTH], "plant": {"effects": []}, "adapt.parameters": ["n", "C", EXPONENT]}
    found = runs(write_scenario, changes | {"initial_estimate.guess": {"n": 1.1, EXPONENT: 0.3}})
    assert error(found["oracle"]) < 1e-9
    rpem = found["rpem"]
    assert rpem.table[f"{EXPONENT}_true"].isna().all() and np.isnan(rpem.fit[EXPONENT])
    assert np.isfinite(rpem.table[f"{EXPONENT}_estimate"][60:]).all() and np.isfinite(rpem.fit["n"])


def test_an_effect_of_the_plant_may_drift(write_scenario: WriteScenario) -> None:
    """Coefficients of the plant's effects take drift like any plant parameter."""
    drift = {EXPONENT: {"profile": "ramp", "change": 1.0, "from_s": 50, "to_s": 90}}
    path = write_scenario({"plant": {"effects": [GROWTH]}, "parameters": drift})
    scenario = load_scenario(path)
    column = Realisation(scenario, 1).parameters[:, scenario.plant_model.index("parameters", EXPONENT)]
    assert (column[0], column[-1]) == (0.4, 0.8)
    table = run_scenario(scenario, ["fixed"], [1])[0].table
    np.testing.assert_array_equal(table[f"{EXPONENT}_true"], column)


def test_a_sensor_effect_changes_what_is_shown_and_not_what_is(write_scenario: WriteScenario) -> None:
    """An offset of the grade analyser: the account sees the grade of the concentrate, the estimators the analyser's."""
    plain = runs(write_scenario, {})["fixed"].table
    off = runs(write_scenario, {"plant": {"effects": [OFFSET]}})["fixed"].table
    np.testing.assert_allclose(off["concentrate_grade_true"], plain["concentrate_grade_true"], rtol=1e-12)
    np.testing.assert_allclose(
        off["concentrate_grade_measured"] - plain["concentrate_grade_measured"], 0.02, atol=1e-12
    )


def test_known_disturbances_come_in_each_models_own_vector(write_scenario: WriteScenario) -> None:
    """A measured feed grade reaches the oracle, whose model has further parameters, as it reaches the others."""
    feed = "feed_concentration.chalcopyrite"
    changes: dict[str, Any] = {
        "parameters": {feed: {"profile": "factors", "at_s": [0, 60], "factors": [1.0, 1.2]}},
        "disturbances": {feed: {}},
        "plant": {"effects": [GROWTH, LATE_FEED]},
        "initial_estimate.guess": {},
    }
    found = runs(write_scenario, changes)
    assert error(found["oracle"]) < 1e-9
    for run in found.values():
        np.testing.assert_array_equal(run.table[f"{feed}_known"], run.table[f"{feed}_true"])


def test_runs_compare_where_the_plant_is_the_same(write_scenario: WriteScenario, model: Model, tmp_path: Path) -> None:
    """What the controller's model knows is method; what the plant does is what is asked."""
    save_model(model.with_effects([]), tmp_path / "plain.yaml")
    plant = {"plant": {"effects": [GROWTH]}}
    asked = conditions(load_scenario(write_scenario(plant)))
    assert asked == conditions(load_scenario(write_scenario({**plant, "effects": [GROWTH]})))
    assert asked == conditions(load_scenario(write_scenario({"effects": [GROWTH]})))
    assert asked == conditions(load_scenario(write_scenario({**plant, "model": "plain.yaml"})))
    other = {**GROWTH, "coefficients": {"exponent": 0.5}}
    assert asked != conditions(load_scenario(write_scenario({"plant": {"effects": [other]}})))
    assert asked != conditions(load_scenario(write_scenario()))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"plant": {"effects": [{**GROWTH, "site": "bubble_siz"}]}}, "plant.effects, number 1: .*'bubble_size'"),
        ({"effects": [GROWTH, {**OFFSET, "form": "shft"}]}, "effects, number 2: .*'shift'"),
        ({"effects": [{**GROWTH, "settings": {"reference": 1.5e-3}}]}, r"write \{value: 0.0015, unit: m3/s\}"),
        ({"effects": [{**GROWTH, "drivr": "air_flow"}]}, "unknown key 'effects.0.drivr'; did you mean 'driver'"),
        ({"plant": {"efects": []}}, "did you mean 'effects'"),
        ({"plant": {"effects": [GROWTH]}, "effects": [GROWTH, GROWTH]}, "two effects"),
        ({"plant": {"effects": []}, "effects": [GROWTH], "parameters": {EXPONENT: None}}, "parameters"),
        ({"model": "extendd.yaml"}, "no such model file"),
        ({"model": "short.yaml"}, "unknown key"),
    ],
)
def test_a_wrong_effect_is_one_line(write_scenario: WriteScenario, changes: dict[str, Any], says: str) -> None:
    path = write_scenario(changes)
    with pytest.raises(AdaptiveFlotError, match=says) as error:
        load_scenario(path)
    assert str(error.value).startswith(str(path)[:-10]) and "\n" not in str(error.value)
