"""The closed loop: who decides when, the account of a run, and the oracle as the only one that sees the truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import ScenarioError
from adaptive_flot.greybox import Model
from adaptive_flot.processes.flotation.account import account
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario


def shortened(**changes: Any) -> Scenario:
    """The drift scenario, two minutes of closed loop."""
    scenario = load_scenario("closed_loop_drift")
    return replace(scenario, file=scenario.file.model_copy(update={"duration_s": 420.0, **changes}))


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return run_scenario(shortened(), seeds=[3])


def test_the_schedule_leads_until_the_estimator_starts(runs: list[Run]) -> None:
    for run in runs:
        early, late = run.table["time_s"] <= 300, run.table["time_s"] > 301
        name = run.controller if run.controller == "hold" else "schedule"
        assert set(run.table["decided_by"][early]) == {name}
        assert set(run.table["decided_by"][late]) == {run.controller}


def test_only_the_cases_of_the_scenario_run(runs: list[Run]) -> None:
    cases = load_scenario("closed_loop_drift").file.cases
    assert [(r.controller, r.estimator) for r in runs] == [(c.controller, c.estimator) for c in cases]


def test_the_mpc_solves_every_thirty_seconds_within_its_limits(runs: list[Run]) -> None:
    for run in runs:
        if run.controller != "economic_mpc":
            continue
        solved = run.table[run.table["solve_seconds"].notna()]
        assert solved["time_s"].tolist() == [302.0, 332.0, 362.0, 392.0]
        assert set(run.table["control_status"]) == {"ok"}
        assert run.table["air_flow_m3_s"].between(9.05e-4, 2.17e-3).all()
        assert np.max(np.abs(np.diff(run.table["air_flow_m3_s"].tail(118)))) <= 2e-4 * 1.001


def test_the_oracle_alone_follows_the_true_parameters() -> None:
    scenario = shortened(
        parameters={
            "C": load_scenario("closed_loop_drift")
            .file.parameters["C"]
            .model_copy(update={"from_s": 310.0, "to_s": 400.0})
        }
    )
    for run in run_scenario(scenario, ["fixed", "oracle"], [3]):
        late = run.table[run.table["time_s"] > 300]
        followed = np.array_equal(late["C_estimate"].to_numpy(), late["C_true"].to_numpy())
        assert followed == (run.estimator == "oracle")
    assert scenario.setup.truth is None


def test_account_by_hand(model: Model) -> None:
    """Two rows: recovered over fed mass, grade by mass of concentrate, one of two samples 0.01 below the limit."""
    table = pd.DataFrame(
        {
            "concentrate_grade_true": [0.25, 0.19],
            "recovery_true": [0.8, 0.9],
            "air_flow_m3_s": [1e-3, 2e-3],
            "feed_flow_m3_s": [1e-4, 3e-4],
        }
    )
    found = account(table, model, 1.0, Prices(metal=2.0, treatment=0.1, air=1.0, reagent=5.0), 0.20)
    fed = 10.6 * np.array([1e-4, 3e-4])
    recovered = fed * [0.8, 0.9]
    assert found["recovery"] == pytest.approx(recovered.sum() / fed.sum())
    assert found["mean_grade"] == pytest.approx(recovered.sum() / (recovered / [0.25, 0.19]).sum())
    assert found["below_limit"] == 0.5 and found["mean_depth"] == pytest.approx(0.01)
    assert found["value_metal_cu_h"] == pytest.approx(3600 * 2.0 * recovered.mean())
    assert found["value_treatment_cu_h"] == pytest.approx(-3600 * 0.1 * (recovered / [0.25, 0.19]).mean())
    assert found["value_air_cu_h"] == pytest.approx(-3600 * 1.5e-3)
    assert found["value_reagent_cu_h"] == pytest.approx(-3600 * 5.0 * 2e-4)
    assert found["value_cu_h"] == pytest.approx(
        sum(found[f"value_{term}_cu_h"] for term in ("metal", "treatment", "air", "reagent"))
    )


@pytest.mark.parametrize(
    ("estimators", "controllers", "expected"),
    [
        ([], ["pi"], [("pi", "fixed")]),
        (["oracle"], [], [("economic_mpc", "oracle")]),
        (["ekf"], [], [("economic_mpc", "ekf")]),
        (["fixed", "ekf"], ["pi"], [("pi", "fixed"), ("pi", "ekf")]),
        (["rpem"], ["schedule"], [("schedule", "rpem")]),
    ],
)
def test_a_name_that_is_given_always_runs(
    estimators: list[str], controllers: list[str], expected: list[tuple[str, str]]
) -> None:
    """Also one that the scenario's cases do not hold: it was left out without a word."""
    assert load_scenario("closed_loop_drift").combinations(estimators, controllers) == expected


def test_a_seed_given_twice_runs_once_and_a_shipped_controller_needs_no_entry() -> None:
    found = run_scenario(shortened(), ["fixed"], [3, 3], controllers=["schedule"])
    assert [(r.controller, r.estimator, r.seed) for r in found] == [("schedule", "fixed", 3)]


def test_an_unknown_controller_is_named_with_the_nearest() -> None:
    with pytest.raises(ScenarioError, match="unknown controller 'economic_mcp'; did you mean 'economic_mpc'"):
        run_scenario(shortened(), controllers=["economic_mcp"])
