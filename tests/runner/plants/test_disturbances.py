"""Disturbances: the plant imposes them, instruments show them as the scenario says, nobody knows them beforehand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml

from adaptive_flot.errors import ScenarioError
from adaptive_flot.processes.flotation.account import account
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.inputs.profiles import Factors, Steps
from adaptive_flot.runner.scenario.keys import DisturbancePart
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.runner.conftest import WriteScenario

FEED, GRADE = "feed_flow_m3_s", "feed_concentration.chalcopyrite"


def disturbed(parts: dict[str, DisturbancePart], **changes: Any) -> Scenario:
    """Ninety seconds of closed loop; feed flow +10 % at 320 s, feed grade +20 % at 340 s."""
    scenario = load_scenario("feed_disturbance")
    file = scenario.file
    update: dict[str, Any] = {
        "duration_s": 390.0,
        "inputs": file.inputs | {FEED: Steps(profile="steps", at_s=[0, 320], values_=[1.67e-4, 1.837e-4])},
        "parameters": {GRADE: Factors(profile="factors", at_s=[0, 340], factors=[1.0, 1.2])},
        "disturbances": parts,
        "cases": [c for c in file.cases if c.controller != "economic_mpc" and c.estimator == "fixed"],
    }
    return replace(scenario, file=file.model_copy(update=update | changes))


def test_the_plant_imposes_what_no_controller_moves() -> None:
    """Whatever a controller returns for the feed flow, the plant's own feed acts, and the sample shows it."""
    for run in run_scenario(disturbed({})):
        expected = np.where(run.table["time_s"] > 320, 1.837e-4, 1.67e-4)
        np.testing.assert_array_equal(run.table[FEED], expected)


def test_controllers_are_not_told_the_future() -> None:
    scenario = disturbed({})
    plan = Realisation(scenario, 1).plan
    feed = scenario.model.index("inputs", "feed_flow")
    assert (plan[:, feed] == 1.67e-4).all()
    moved = [j for j in range(plan.shape[1]) if j != feed]
    np.testing.assert_array_equal(plan[:, moved], Realisation(scenario, 1).schedule[:, moved])


def test_unmeasured_is_taken_for_what_was_planned() -> None:
    scenario = disturbed({FEED: DisturbancePart(measured=False), GRADE: DisturbancePart(measured=False)})
    found = Realisation(scenario, 1).disturbances()
    feed = scenario.model.index("inputs", "feed_flow")
    assert found.inputs[-1, feed] == 1.837e-4 and (found.shown[:, feed] == 1.67e-4).all()
    assert found.parameters is None
    run = run_scenario(scenario)[0]
    assert run.table[f"{FEED}_true"].iloc[-1] == 1.837e-4 and run.table[FEED].iloc[-1] == 1.67e-4


def test_an_analyser_repeats_its_last_value_and_shows_it_late() -> None:
    """Every 30 s, 10 s late: the step at 340 s is first measured at 360 s and known at 370 s; row k ends at k + 1 s."""
    scenario = disturbed({GRADE: DisturbancePart(every_s=30, dead_time_s=10)})
    known = Realisation(scenario, 1).disturbances().parameters
    assert known is not None
    values = known[:, scenario.model.index("parameters", GRADE)]
    np.testing.assert_allclose(values, np.where(np.arange(1, 391) >= 370, 12.72, 10.6))


def test_measurement_noise_is_drawn_for_each_seed_and_held_between_measurements() -> None:
    scenario = disturbed({GRADE: DisturbancePart(every_s=30, noise_std=0.1), FEED: DisturbancePart(noise_std=1e-6)})
    one, again, two = (Realisation(scenario, seed).disturbances() for seed in (1, 1, 2))
    feed = scenario.model.index("inputs", "feed_flow")
    assert one.parameters is not None and two.parameters is not None and again.parameters is not None
    np.testing.assert_array_equal(one.shown, again.shown)
    np.testing.assert_array_equal(one.parameters, again.parameters)
    assert not np.array_equal(one.parameters, two.parameters)
    assert np.std(one.shown[:320, feed]) == pytest.approx(1e-6, rel=0.15)
    assert len(np.unique(one.parameters[:, scenario.model.index("parameters", GRADE)])) == 14  # nominal, then 13 values


def test_a_measured_feed_grade_enters_the_prediction() -> None:
    """With an exact analyser the simulation from nominal parameters is the plant itself, from start to end."""
    error = {}
    for measured in (True, False):
        run = run_scenario(disturbed({GRADE: DisturbancePart(measured=measured)}))[0]
        last = run.table.iloc[-1]
        error[measured] = abs(last["concentrate_grade_predicted"] - last["concentrate_grade_true"])
    assert error[True] < 1e-9 and error[False] > 3e-3


def test_the_account_counts_the_feed_that_came() -> None:
    """Recovered over fed mass: the mean of the recovery weighed with the true feed, not with the nominal one."""
    scenario = disturbed({})
    run = run_scenario(scenario)[0]
    late = run.table[run.table["time_s"] > 300]
    fed = late[FEED] * late[f"{GRADE}_true"]
    assert scenario.prices is not None
    found = account(late, scenario.model, 1.0, scenario.prices, 0.2)
    assert found["recovery"] == pytest.approx((late["recovery_true"] * fed).sum() / fed.sum())
    assert found == pytest.approx(run.account)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("feed_flw_m3_s", "did you mean 'feed_flow_m3_s'"),
        ("feed_concentration.chalcopyrit", "did you mean 'feed_concentration.chalcopyrite'"),
        ("air_flow_m3_s", "name an input without a range in 'limits'"),
        ("C", "'C' is adapted"),
    ],
)
def test_a_wrong_disturbance_is_one_clear_line(write_scenario: WriteScenario, key: str, message: str) -> None:
    limits = yaml.safe_load(
        "{concentrate_grade: 0.2, level_m: [0.33, 0.42], largest_move: {air_flow_m3_s: 2e-4},"
        " inputs: {air_flow_m3_s: [9e-4, 2e-3], level_setpoint_m: [0.33, 0.42]}}"
    )
    with pytest.raises(ScenarioError, match=message):
        load_scenario(write_scenario({"disturbances": {key: {}}, "limits": limits}))
