"""Runs of a scenario: what the estimators of one seed share, what is compared, and what they must not see."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from adaptive_flot import plugins
from adaptive_flot.contracts import ControllerSetup, Prior, Setup
from adaptive_flot.errors import AdaptiveFlotError, ScenarioError
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from controllers.schedule import Schedule
from estimators.fixed import Fixed, FixedState
from tests.runner.conftest import DURATION, INITIAL, WriteScenario

Runs = dict[tuple[str, int], Run]


@pytest.fixture
def by_name(runs: list[Run]) -> Runs:
    return {(run.estimator, run.seed): run for run in runs}


def column(run: Run, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return run.table[name].to_numpy(dtype=float)


SHARED = ["time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m", "concentrate_grade_true",
          "concentrate_grade_measured", "level_m_measured", "n_true", "C_true"]  # fmt: skip


def test_every_combination_ran_in_order(runs: list[Run]) -> None:
    assert [(r.seed, r.controller, r.estimator) for r in runs] == [
        (seed, "schedule", name) for seed in (1, 2) for name in ("fixed", "rpem")
    ]


def test_estimators_of_one_seed_see_the_same_run_to_the_bit(by_name: Runs) -> None:
    assert_frame_equal(by_name["fixed", 1].table[SHARED], by_name["rpem", 1].table[SHARED], check_exact=True)


def test_another_seed_is_another_noise_and_another_setpoint(by_name: Runs) -> None:
    one, two = by_name["rpem", 1], by_name["rpem", 2]
    assert not np.array_equal(column(one, "level_setpoint_m"), column(two, "level_setpoint_m"))
    noise = [column(r, "concentrate_grade_measured") - column(r, "concentrate_grade_true") for r in (one, two)]
    assert abs(np.corrcoef(noise[0], noise[1])[0, 1]) < 0.3
    np.testing.assert_array_equal(column(one, "air_flow_m3_s"), column(two, "air_flow_m3_s"))


def test_the_same_seed_gives_the_same_tables_and_fits_to_the_bit(scenario: Scenario, by_name: Runs) -> None:
    again = run_scenario(scenario, seeds=[2])
    for run in again:
        first = by_name[run.estimator, 2]
        assert_frame_equal(run.table, first.table, check_exact=True)
        assert {**run.summary(), "seconds": 0} == {**first.summary(), "seconds": 0}


def test_a_run_does_not_depend_on_what_ran_beside_it(scenario: Scenario, by_name: Runs) -> None:
    """The initial estimate is shared by the estimators of a seed; alone, each gets the same."""
    alone = run_scenario(scenario, ["rpem"], [1])[0]
    assert_frame_equal(alone.table, by_name["rpem", 1].table, check_exact=True)


def test_noise_is_white_gaussian_with_the_standard_deviation_of_the_file(write_scenario: WriteScenario) -> None:
    loaded = load_scenario(write_scenario({"duration_s": 5000}))
    noise = Realisation(loaded, 3).measurement_noise
    for name, std in (("concentrate_grade", 1e-3), ("level", 2e-3)):
        own = noise[:, loaded.model.index("outputs", name)]
        assert own.std() == pytest.approx(std, rel=0.03) and abs(own.mean()) < 0.05 * std
        assert abs(np.corrcoef(own[1:], own[:-1])[0, 1]) < 0.04
        assert np.mean(np.abs(own) < std) == pytest.approx(0.683, abs=0.02)
    measured = loaded.model.indices("outputs", ["concentrate_grade", "level"])
    assert np.isnan(np.delete(noise, measured, axis=1)).all()
    assert abs(np.corrcoef(noise[:, measured[0]], noise[:, measured[1]])[0, 1]) < 0.04


def test_noise_does_not_depend_on_how_long_the_run_is_or_what_else_is_adapted(write_scenario: WriteScenario) -> None:
    """So a shortened scenario is the beginning of the long one."""
    long, short = (
        Realisation(load_scenario(write_scenario({"duration_s": d, "fits_after_s": 50})), 3).measurement_noise
        for d in (120, 60)
    )
    np.testing.assert_array_equal(long[:60], short)


def test_fit_is_the_formula_of_the_paper_over_the_later_rows(by_name: Runs) -> None:
    """100 (1 - |true - estimate| / |true|) over t > 60 s, by hand."""
    for run in by_name.values():
        late = run.table[run.table["time_s"] > 60]
        assert late["time_s"].min() == 61 and len(late) == DURATION - 60
        expected = {}
        for label, true, found in (
            ("n", "n_true", "n_estimate"),
            ("C", "C_true", "C_estimate"),
            ("concentrate_grade", "concentrate_grade_true", "concentrate_grade_predicted"),
        ):
            t, e = (late[c].to_numpy(dtype=float) for c in (true, found))
            expected[label] = 100 * (1 - np.sqrt(((t - e) ** 2).sum()) / np.sqrt((t**2).sum()))
        assert run.fit == pytest.approx(expected, rel=1e-12)
        assert list(run.fit) == ["n", "C", "concentrate_grade"]


def test_adaptation_beats_the_nominal_parameters_and_follows_the_drift(by_name: Runs) -> None:
    """C rises by 20 % from 50 s to 90 s: what the whole thing is for."""
    for seed in (1, 2):
        fixed, rpem = by_name["fixed", seed], by_name["rpem", seed]
        assert rpem.fit["concentrate_grade"] > fixed.fit["concentrate_grade"] + 1.0
        assert rpem.fit["concentrate_grade"] > 95.0


def test_row_k_holds_the_inputs_and_the_truth_of_the_interval_that_ends_there(
    scenario: Scenario, by_name: Runs
) -> None:
    """Row k is at (k + 1) dt and shows what the profiles say at the start of its interval, k dt."""
    run = by_name["rpem", 1]
    np.testing.assert_array_equal(column(run, "time_s"), np.arange(1.0, DURATION + 1))
    np.testing.assert_array_equal(column(run, "air_flow_m3_s"), Realisation(scenario, 1).schedule[:, 0])
    air = column(run, "air_flow_m3_s")
    assert air[19] == 9.05e-4 and air[20] > air[19], "the first step is at 20 s: the row of 21 s is the first with it"
    true = column(run, "C_true")
    assert true[50] == 6.38e-4 and true[51] == pytest.approx(6.38e-4 * (1 + 0.2 / 40))


def test_truth_is_the_simulation_of_the_same_inputs(scenario: Scenario, by_name: Runs) -> None:
    """Open loop: `Stepper.simulate` from the steady state of the first inputs, in one call."""
    model, schedule, p = scenario.model, Realisation(scenario, 1).schedule, Realisation(scenario, 1).parameters
    x0 = steady_state(model, schedule[0], p[0]).state
    expected = Stepper(model, 1.0).simulate(x0, schedule, p)
    for j, q in enumerate(model.outputs):
        np.testing.assert_allclose(column(by_name["rpem", 1], f"{q.column}_true"), expected.outputs[:, j], rtol=1e-10)


def test_measured_is_truth_plus_the_noise_of_the_seed(scenario: Scenario, by_name: Runs) -> None:
    noise = Realisation(scenario, 1).measurement_noise[:, scenario.model.index("outputs", "concentrate_grade")]
    run = by_name["fixed", 1]
    difference = column(run, "concentrate_grade_measured") - column(run, "concentrate_grade_true")
    np.testing.assert_allclose(difference, noise, atol=1e-15)


def test_the_accurate_plant_agrees_with_the_fast_one(write_scenario: WriteScenario) -> None:
    short = {"duration_s": 30, "initial_estimate.until_s": 15, "fits_after_s": 15}
    fast, accurate = (
        run_scenario(load_scenario(write_scenario({**short, "plant": {"integrator": i}})), ["fixed"], [1])[0]
        for i in ("fast", "accurate")
    )
    a, b = column(fast, "concentrate_grade_true"), column(accurate, "concentrate_grade_true")
    np.testing.assert_allclose(a, b, rtol=1e-4)
    assert not np.array_equal(a, b)


def test_statuses_are_counted_and_the_initial_part_has_no_estimates(by_name: Runs) -> None:
    run = by_name["rpem", 1]
    assert run.status_counts == {"initialising": INITIAL, "ok": DURATION - INITIAL}
    assert run.table["status"].value_counts().to_dict() == run.status_counts
    early = run.table.iloc[:INITIAL]
    for name in ("n_estimate", "C_std", "concentrate_grade_predicted", "concentrate_grade_innovation"):
        assert early[name].isna().all() and run.table[name].iloc[INITIAL:].notna().all()


def test_innovation_is_measured_minus_predicted(by_name: Runs) -> None:
    table = by_name["rpem", 1].table.iloc[INITIAL:]
    for q in ("concentrate_grade", "level_m"):
        expected = table[f"{q}_measured"] - table[f"{q}_predicted"]
        pd.testing.assert_series_equal(table[f"{q}_innovation"], expected, check_names=False)


def test_projections_are_counted(write_scenario: WriteScenario, tmp_path: Path) -> None:
    """Bounds of 1 % around the nominal values and an unsure prior: the estimates run into them."""
    from adaptive_flot.resources import cell_file

    cell = cell_file().read_text()
    cell = cell.replace("growth_exponent:      {", "growth_exponent:      {bounds: [0.99, 1.01], ")
    cell = cell.replace("coalescence_rate:     {", "coalescence_rate:     {bounds: [6.32e-4, 6.44e-4], ")
    assert cell.count("bounds") == 2
    (tmp_path / "narrow.yaml").write_text(cell)
    changes = {"cell": "narrow.yaml", "parameters": {}, "initial_estimate.guess": {},
               "estimators.rpem.options": {"l0_scale": 1e4}}  # fmt: skip
    run = run_scenario(load_scenario(write_scenario(changes)), ["rpem"], [1])[0]
    assert run.status_counts["projected"] > 3
    assert run.status_counts["projected"] == (run.table["status"] == "projected").sum()
    estimates = run.table["n_estimate"].dropna()
    assert estimates.between(0.99, 1.01).all()


def test_noise_free_measurements_are_no_special_case(write_scenario: WriteScenario) -> None:
    changes = {"measurements.concentrate_grade.noise_std": 0.0, "parameters": {}}
    run = run_scenario(load_scenario(write_scenario(changes)), ["rpem"], [1])[0]
    assert run.fit["concentrate_grade"] == pytest.approx(100.0, abs=1e-3)
    assert run.fit["n"] == pytest.approx(100.0, abs=0.1) and run.fit["C"] == pytest.approx(100.0, abs=0.1)


def test_one_adapted_parameter_is_no_special_case(write_scenario: WriteScenario) -> None:
    changes = {"adapt.parameters": ["C"], "initial_estimate.guess": {"C": 5.5e-4}}
    fixed, rpem = run_scenario(load_scenario(write_scenario(changes)), seeds=[1])
    assert list(rpem.fit) == ["C", "concentrate_grade"] and rpem.fit["C"] > fixed.fit["C"] + 3.0
    assert rpem.table["C_std"].iloc[-1] < 0.1 * rpem.table["C_true"].iloc[-1]


def test_the_truth_is_hidden_from_estimators_and_controllers(
    write_scenario: WriteScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They get the nominal model; the plant's parameters differ from it from the first interval on."""
    seen: list[Setup | ControllerSetup] = []
    priors: list[Prior] = []

    class SpyEstimator(Fixed):
        def __init__(self, setup: Setup) -> None:
            seen.append(setup)
            super().__init__(setup)

        def init(self, prior: Prior) -> FixedState:
            priors.append(prior)
            return super().init(prior)

    class SpyController(Schedule):
        def __init__(self, setup: ControllerSetup) -> None:
            seen.append(setup)
            super().__init__(setup)

    monkeypatch.setitem(vars(plugins)["ESTIMATORS"], "fixed", "spies:SpyEstimator")
    monkeypatch.setitem(vars(plugins)["CONTROLLERS"], "schedule", "spies:SpyController")
    module = ModuleType("spies")
    vars(module).update(SpyEstimator=SpyEstimator, SpyController=SpyController)
    monkeypatch.setitem(sys.modules, "spies", module)

    changed = {"C": {"profile": "step", "change": 0.3, "from_s": 0, "to_s": 1}}
    loaded = load_scenario(write_scenario({"parameters": changed, "initial_estimate.guess": {}}))
    run = run_scenario(loaded, ["fixed"], [1])[0]
    nominal = load_scenario(write_scenario({"parameters": {}})).model.parameter_values
    assert len(seen) == 2 and run.table["C_true"].iloc[0] == pytest.approx(1.3 * 6.38e-4)
    for setup in seen:
        np.testing.assert_array_equal(setup.model.parameter_values, nominal)
    # `start: nominal` hands over the nominal values and the nominal model's own state, not the plant's
    np.testing.assert_array_equal(priors[0].parameters, [1.0, 6.38e-4])
    expected = Stepper(loaded.model, 1.0).simulate(
        steady_state(loaded.model, Realisation(loaded, 1).schedule[0]).state, Realisation(loaded, 1).schedule[:INITIAL]
    )
    np.testing.assert_allclose(priors[0].state, expected.states[-1], rtol=1e-9)
    assert priors[0].time == INITIAL


def test_initial_estimate_starts_from_the_guess_and_finds_the_truth(by_name: Runs) -> None:
    """The estimators start with what the batch fit of the first part says, n = 1 and C = 6.38e-4 within its spread."""
    for run in by_name.values():
        error = (run.initial.values() - [1.0, 6.38e-4]) / [e.std for e in run.initial.estimates]
        assert np.all(np.abs(error) < 4)
    started = by_name["rpem", 1]
    assert started.table["n_estimate"].iloc[INITIAL] == pytest.approx(started.initial.values()[0], abs=0.02)
    assert by_name["fixed", 1].table["n_estimate"].iloc[INITIAL] == 1.0


@pytest.mark.parametrize(("name", "hint"), [("rpm", "did you mean 'rpem'"), ("kalman", "known: .*fixed, .*rpem")])
def test_an_unknown_estimator_is_named_with_the_nearest(scenario: Scenario, name: str, hint: str) -> None:
    with pytest.raises(ScenarioError, match=f"short.yaml: unknown estimator '{name}'; {hint}"):
        run_scenario(scenario, [name])


def test_a_seed_whose_random_input_leaves_the_model_is_an_error(write_scenario: WriteScenario) -> None:
    """Inputs are checked for the seeds asked for too, not only for those of the file; the lip is at 0.48 m."""
    profile = {"profile": "random", "between": [0.40, 0.485], "every_s": 30, "seed": "per_run"}
    safe = load_scenario(write_scenario())
    draw = safe.file.inputs["level_setpoint_m"].model_copy(update={"between": (0.40, 0.485)})
    levels = {seed: draw.values(safe.starts, seed) for seed in range(100)}
    good = next(seed for seed, level in levels.items() if level.max() < 0.47)
    bad = next(seed for seed, level in levels.items() if level[0] < 0.47 and level.max() > 0.4796)
    loaded = load_scenario(write_scenario({"inputs.level_setpoint_m": profile, "seeds": [good]}))
    with pytest.raises(AdaptiveFlotError, match=r"level_setpoint = 0\.48"):
        run_scenario(loaded, ["fixed"], [bad])
