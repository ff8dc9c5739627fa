"""A plant with other constants than the model, and with a feed that wanders: who knows of it, and what is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.processes.flotation.cell_file import save_cell
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.inputs.profiles import FeedWalk
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.targets import scenario_inputs
from tests.runner.conftest import WriteScenario

FEED, GRADE = "feed_flow_m3_s", "feed_concentration.chalcopyrite"
ORACLE = {"estimators.oracle": {"use": "oracle", "start": "nominal"}, "seeds": [1]}
WALK = {"share": 0.1, "correlation_s": 300.0}


@pytest.fixture
def other(tmp_path: Path) -> str:
    """A cell with another bursting rate and another C, beside the scenario."""
    save_cell(cell_file(), {"burst_b": 0.8, "coalescence_rate": 7.0e-4}, "a test", tmp_path / "other.yaml")
    return "other.yaml"


def test_only_the_oracle_knows_the_plants_cell(write_scenario: WriteScenario, other: str) -> None:
    """The truth of C is the plant's, the model of the others stays nominal, and the fingerprint tells them apart."""
    path = write_scenario({**ORACLE, "plant": {"cell": other}})
    scenario = load_scenario(path)
    runs = {run.estimator: run.table[run.table["time_s"] > 60] for run in run_scenario(scenario)}
    off = {k: np.abs(t["concentrate_grade_true"] - t["concentrate_grade_predicted"]).max() for k, t in runs.items()}
    assert off["oracle"] < 1e-9 and off["fixed"] > 1e-3
    assert runs["fixed"]["C_true"].iloc[-1] == pytest.approx(1.2 * 7.0e-4)
    assert scenario.model.parameters[scenario.model.index("parameters", "C")].value == 6.38e-4
    assert path.parent / other in scenario_inputs(scenario)
    assert conditions(scenario) != conditions(load_scenario(write_scenario(ORACLE)))


def test_the_models_own_cell_is_no_difference(write_scenario: WriteScenario) -> None:
    """The same cell named for the plant: the same run to the bit, and runs compare."""
    plain, named = (load_scenario(write_scenario(c)) for c in ({}, {"plant": {"cell": "lab_87l"}}))
    one, two = (run_scenario(s, ["rpem"], [1])[0].table for s in (plain, named))
    assert one.equals(two) and conditions(plain) == conditions(named)


def test_a_walk_has_its_spread_and_its_memory() -> None:
    """Over 20 000 s of a 20 s memory: standard deviation within 5 % and autocorrelation 1/e after its time."""
    walk = np.log(FeedWalk(share=0.2, correlation_s=20.0).factor(np.arange(20000.0), 1, FEED))
    assert walk[0] == 0.0
    assert walk.std() == pytest.approx(0.2, rel=0.05)
    assert np.corrcoef(walk[:-20], walk[20:])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)


def test_a_wandering_feed_is_the_plants_and_known_as_the_file_says(write_scenario: WriteScenario) -> None:
    """An open loop too: the flow acts as it wanders and is taken as planned; the grade moves, and nobody is told."""
    changes: dict[str, Any] = {"plant": {"feed_walk": {FEED: WALK, GRADE: WALK}}}
    plain = Realisation(load_scenario(write_scenario()), 1)
    hidden = load_scenario(write_scenario({**changes, "disturbances": {FEED: {"measured": False}}}))
    assert hidden.setup.unmeasured == ()  # an input: only parameters of the model can be estimated
    table = run_scenario(hidden, ["fixed"], [1])[0].table
    wandering = Realisation(hidden, 1)
    flow = wandering.schedule[:, 1] / plain.schedule[:, 1]
    assert flow[0] == 1.0 and np.ptp(flow) > 0.01
    np.testing.assert_array_equal(table[f"{FEED}_true"], wandering.schedule[:, 1])
    assert (table[FEED] == 1.67e-4).all()
    grade = table[f"{GRADE}_true"].to_numpy() / 10.6
    assert np.ptp(grade) > 0.01 and abs(np.corrcoef(grade, flow)[0, 1]) < 1.0 - 1e-6
    np.testing.assert_array_equal(wandering.measurement_noise, plain.measurement_noise)
    shown = run_scenario(load_scenario(write_scenario(changes)), ["fixed"], [1])[0].table
    np.testing.assert_array_equal(shown[FEED], wandering.schedule[:, 1])


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"plant": {"cell": "lab_78l"}}, "plant.cell: lab_78l: no such cell file; did you mean 'lab_87l'"),
        ({"plant": {"feed_walk": {"feed_flw_m3_s": WALK}}}, "plant.feed_walk: .*feed_flw_m3_s"),
        ({"plant": {"feed_walk": {FEED: {"share": 0.1}}}}, "correlation_s"),
        ({"plant": {"feed_walk": {FEED: {**WALK, "share": 9.0}}}}, "share.*less than or equal to 1"),
        ({"model": "cascaded-tanks", "plant": {"cell": "lab_87l"}}, "takes no cell file"),
    ],
)
def test_a_wrong_plant_is_one_line(write_scenario: WriteScenario, changes: dict[str, Any], says: str) -> None:
    path = write_scenario(changes)
    with pytest.raises(AdaptiveFlotError, match=says) as error:
        load_scenario(path)
    assert str(error.value).startswith(str(path)[:-10]) and "\n" not in str(error.value)
