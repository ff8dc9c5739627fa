"""Scenario files: what is read is what was written, and every mistake is one line with the file and the key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.errors import AdaptiveFlotError, ScenarioError
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario, shipped_scenarios
from adaptive_flot.runner.scenario.measurement_noise import noise_std
from adaptive_flot.runner.scenario.realisation import Realisation
from benchmarks.timing import scipy_reference
from tests.runner.conftest import WriteScenario

PROFILE = "inputs.air_flow_m3_s"

# changes by dotted path, and what the message must hold beside the name of the file
MISTAKES: dict[str, tuple[dict[str, Any], list[str]]] = {
    "unknown key": ({"seedz": [1]}, ["'seedz'", "did you mean 'seeds'"]),
    "unknown key in a part": ({"adapt.parameter": ["n"]}, ["adapt.parameter", "did you mean 'parameters'"]),
    "unknown key deep down": (
        {"initial_estimate.guss": {}},
        ["initial_estimate.guss", "did you mean 'guess'"],
    ),
    "unknown key of an estimator": ({"estimators.rpem.option": {}}, ["estimators.rpem.option", "mean 'options'"]),
    "unknown key of a measurement": (
        {"measurements.level.noise_sdt": 1.0},
        ["measurements.level", "noise_sdt", "did you mean 'noise_std'"],
    ),
    "unknown key of a change": ({"parameters.C.chnge": 1.0}, ["parameters.C", "chnge", "did you mean 'change'"]),
    "unknown key of a profile": ({f"{PROFILE}.evry_s": 3}, [PROFILE, "evry_s", "did you mean 'every_s'"]),
    "unknown profile": ({f"{PROFILE}.profile": "stairs"}, [PROFILE, "stairs"]),
    "missing key": ({"duration_s": ...}, ["'duration_s' is missing"]),
    "missing key of a profile": ({f"{PROFILE}.from": ...}, [PROFILE, "from", "missing"]),
    "text for a number": ({"duration_s": "long"}, ["duration_s", "'long'"]),
    "number for a list": ({"seeds": 3}, ["seeds", "3"]),
    "negative duration": ({"duration_s": -5}, ["duration_s", "-5"]),
    "infinite duration": ({"duration_s": float("inf")}, ["duration_s"]),
    "duration beyond all memory": ({"duration_s": 1e30}, ["duration_s"]),
    "duration of no interval": ({"duration_s": 1e-3}, ["duration_s"]),
    "negative seed": ({"seeds": [1, -1]}, ["seeds", "-1"]),
    "negative seed of a profile": ({"inputs.level_setpoint_m.seed": -3}, ["level_setpoint_m", "-3"]),
    "limits of a random input turned round": ({"inputs.level_setpoint_m.between": [0.42, 0.33]}, ["level_setpoint"]),
    "negative noise": ({"measurements.level.noise_std": -1.0}, ["measurements.level.noise_std", "-1"]),
    "infinite noise": ({"measurements.level.noise_std": float("inf")}, ["measurements.level.noise_std"]),
    "ramp that ends before it starts": ({"parameters.C.to_s": 20}, ["parameters.C", "to_s must lie after"]),
    "missing input": ({PROFILE: ...}, ["inputs", "air_flow_m3_s", "missing"]),
    "unknown input": (
        {"inputs.airflow_m3_s": {"profile": "constant", "value": 1e-3}},
        ["airflow_m3_s", "did you mean 'air_flow_m3_s'"],
    ),
    "input above the cell": (
        {"inputs.level_setpoint_m": {"profile": "constant", "value": 0.6}},
        ["level_setpoint", "0.6", "[0.00048, 0.47952]"],
    ),
    "input not a number": ({PROFILE: {"profile": "constant", "value": float("nan")}}, ["air_flow", "nan"]),
    "unknown adapted parameter": ({"adapt.parameters": ["growth"]}, ["'growth'", "growth_exponent"]),
    "unknown driving output": ({"adapt.outputs": ["grade"]}, ["'grade'", "concentrate_grade"]),
    "unmeasured driving output": ({"adapt.outputs": ["recovery"]}, ["adapt.outputs", "'recovery'", "measurements"]),
    "unknown measurement": ({"measurements.grad": {"noise_std": 1.0}}, ["'grad'"]),
    "unknown true parameter": ({"parameters.nn": {"change": 0.1, "from_s": 1, "to_s": 2}}, ["'nn'"]),
    "true parameter out of range": (
        {"parameters.n": {"change": -0.9, "from_s": 1, "to_s": 2}},
        ["growth_exponent", "0.1"],
    ),
    "unknown guess": ({"initial_estimate.guess": {"nn": 1.0}}, ["'nn'"]),
    "guess out of range": ({"initial_estimate.guess": {"n": 99.0}}, ["guess", "99"]),
    "initial estimate after the end": ({"initial_estimate.until_s": 120}, ["initial_estimate.until_s", "120"]),
    "initial estimate that rounds to the end": ({"initial_estimate.until_s": 119.7}, ["initial_estimate.until_s"]),
    "initial estimate of less than an interval": ({"initial_estimate.until_s": 0.4}, ["initial_estimate.until_s"]),
    "fits before there is an estimate": ({"fits_after_s": 10}, ["fits_after_s", "10"]),
    "fits after the end": ({"fits_after_s": 120}, ["fits_after_s"]),
    "duration that is no whole number of intervals": ({"duration_s": 120.5}, ["duration_s"]),
    "unknown estimator": ({"estimators.rpem.use": "rpm"}, ["'rpm'", "did you mean 'rpem'"]),
    "unknown controller": ({"controllers": {"own": {"use": "schedul"}}}, ["'schedul'", "did you mean 'schedule'"]),
    "unknown method": ({"initial_estimate.method": "pme"}, ["'pme'", "did you mean 'pem'"]),
    "no such module": ({"estimators.rpem.use": "my_missing_file:Mine"}, ["my_missing_file"]),
    "option out of range": ({"estimators.rpem.options": {"forgetting": 2.0}}, ["forgetting", "2"]),
    "unknown option": ({"estimators.rpem.options": {"forgeting": 0.9}}, ["forgeting"]),
    "option of the batch fit": ({"initial_estimate.options": {"initial_state": "x"}}, ["initial_state", "'x'"]),
    "no estimator": ({"estimators": {}}, ["estimators"]),
    "unknown cell": ({"cell": "lab_88l"}, ["lab_88l", "did you mean 'lab_87l'"]),
    "unknown model": ({"model": "flotaton"}, ["flotaton", "did you mean 'flotation'"]),
    "cell for a model without one": ({"model": "cascaded-tanks", "cell": "lab_87l"}, ["cell", "cascaded-tanks"]),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_the_file_and_the_key(mistake: str, write_scenario: WriteScenario) -> None:
    changes, says = MISTAKES[mistake]
    file = write_scenario(changes)
    with pytest.raises(AdaptiveFlotError) as caught:
        run_scenario(load_scenario(file))
    message = str(caught.value)
    assert "\n" not in message
    for part in (str(file), *says):
        assert part in message


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "holds no keys"),
        (b"- a\n- b\n", "holds no keys"),
        (b"just words", "holds no keys"),
        (b"a: [1, 2", "not a YAML file"),
        (b"\xff\xfe\x00\x01\x89PNG", "not a YAML file"),
        (b"a: \x00", "not a YAML file"),
    ],
)
def test_what_is_no_scenario_at_all_is_said_so(tmp_path: Path, content: bytes, says: str) -> None:
    file = tmp_path / "broken.yaml"
    file.write_bytes(content)
    with pytest.raises(ScenarioError, match=says) as caught:
        load_scenario(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"parameters": {"C": {"profile": "factor"}}},
            "parameters.C: unknown profile 'factor'; did you mean 'factors'?",
        ),
        (
            {"parameters": {"C": {"profile": "factors", "at_s": [0.0], "factors": []}}},
            "parameters.C.factors: at_s must",
        ),
        ({"parameters": {"C": {"chnge": 0.1, "from_s": 1, "to_s": 2}}}, "did you mean 'change'?"),
        ({"parameters": {"C": 3}}, "parameters.C.ramp: Input should be keys with their values, got 3"),
        ({"seeds": []}, "seeds: needs at least 1 entry, got []"),
        ({"duration_s": "x"}, "duration_s: Input should be a valid number, got 'x'"),
    ],
)
def test_no_name_of_a_class_or_a_function_is_told(
    changes: dict[str, Any], says: str, write_scenario: WriteScenario
) -> None:
    """What pydantic calls its steps, and our classes, is nothing that a file holds."""
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write_scenario(changes))
    said = str(caught.value)
    assert says in said
    assert not any(word in said for word in ("function", "Change", "after validation", "instance of", "unable to"))


@pytest.mark.parametrize("name", ["paper_scenaro_1", "nowhere/mine.yaml", "nowhere/paper_scenario_1.yaml", "."])
def test_an_unknown_scenario_names_the_shipped_ones(name: str) -> None:
    """Also where only the last part of a path is that of a shipped one: the file asked for is not there."""
    with pytest.raises(ScenarioError, match=r"file; (did you mean '\w+'\? S|s)hipped: \w+, .*paper_scenario_1"):
        load_scenario(name)


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_loads_by_name(name: str) -> None:
    loaded = load_scenario(name)
    assert loaded.name == name and len(Realisation(loaded, 1).schedule) == len(Realisation(loaded, 1).parameters)


@pytest.mark.parametrize("name", [n for n in shipped_scenarios() if n.startswith("paper")])
def test_the_paper_scenarios_are_those_of_the_paper(name: str) -> None:
    loaded = load_scenario(name)
    schedule, truth = Realisation(loaded, 1).schedule, Realisation(loaded, 1).parameters
    model = loaded.model
    assert schedule.shape == (2400, 3) and loaded.initial_rows == 600
    assert loaded.setup.parameters == ("growth_exponent", "coalescence_rate")
    air = schedule[:, model.index("inputs", "air_flow")]
    assert {round(float(air[0]), 9), round(float(air[-1]), 9)} == {9.05e-4, 2.17e-3}
    assert (air[0] < air[-1]) == ("_1" in name)
    for label, start, end in (("C", 600, 1200), ("n", 1200, 1800)):
        factor = truth[:, model.index("parameters", label)] / truth[0, model.index("parameters", label)]
        assert factor[start - 1] == 1.0 and factor[end] == pytest.approx(1.2)
        assert factor[(start + end) // 2] == pytest.approx(1.2 if name.endswith("step") else 1.1)


@pytest.mark.parametrize("level", np.linspace(0.33, 0.42, 7).round(3))
@pytest.mark.parametrize("air", [9.05e-4, 2.17e-3])
def test_every_start_that_the_paper_s_scenarios_may_draw_has_its_steady_state(air: float, level: float) -> None:
    """A run starts steady at its first inputs; the level set-point is any in [0.33, 0.42] m, another for each seed."""
    u = np.array([air, 1.67e-4, level])
    expected = scipy_reference.steady_state(u, scipy_reference.THETA_NOMINAL)
    found = steady_state(load_scenario("paper_scenario_1").model, u).state
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_shipped_scenario_is_found_by_file_name_too() -> None:
    assert load_scenario("paper_scenario_1.yaml").path == shipped_scenarios()["paper_scenario_1"]


def test_a_cell_file_is_found_beside_the_scenario(write_scenario: WriteScenario, tmp_path: Path) -> None:
    cell = (shipped_scenarios()["paper_scenario_1"].parent / "cells" / "lab_87l.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(cell.replace("6.38e-4", "7.00e-4"))
    loaded = load_scenario(write_scenario({"cell": "mine.yaml"}))
    assert loaded.model.parameters[loaded.model.index("parameters", "C")].value == 7.0e-4


def test_noise_belongs_to_the_measured_outputs_only(write_scenario: WriteScenario) -> None:
    loaded = load_scenario(write_scenario())
    std = dict(zip(loaded.model.names("outputs"), noise_std(loaded), strict=True))
    assert std.pop("concentrate_grade") == 1e-3 and std.pop("level") == 2e-3
    assert np.isnan(list(std.values())).all()


def test_times_follow_the_sampling_interval(write_scenario: WriteScenario) -> None:
    loaded = load_scenario(write_scenario({"sampling_s": 0.5}))
    assert loaded.starts.tolist() == [0.5 * k for k in range(240)]
    assert loaded.initial_rows == 80 and loaded.setup.dt == 0.5


def test_estimators_are_told_which_parameters_nobody_measures() -> None:
    assert load_scenario("feed_disturbance_unmeasured").setup.unmeasured == ("feed_concentration.chalcopyrite",)
    assert load_scenario("feed_disturbance").setup.unmeasured == ()


def test_without_estimators_the_default_one_runs(write_scenario: WriteScenario) -> None:
    """With its own defaults; estimators that a person names stay alone."""
    scenario = load_scenario(write_scenario({"estimators": ...}))
    assert scenario.file.estimators == {DEFAULT_ESTIMATOR: Plugin(use=DEFAULT_ESTIMATOR)}
    (run,) = run_scenario(scenario, seeds=[1])
    assert run.estimator == DEFAULT_ESTIMATOR
    assert np.isfinite(run.table[["n_estimate", "C_estimate"]].iloc[-1].to_numpy(dtype=float)).all()
    assert set(load_scenario(write_scenario()).file.estimators) == {"fixed", "rpem"}


@pytest.mark.parametrize("name", [n for n in shipped_scenarios() if load_scenario(n).file.limits is not None])
def test_every_shipped_closed_loop_has_the_default_estimator(name: str) -> None:
    """Beside the economic MPC: that is what a person gets who copies the scenario."""
    scenario = load_scenario(name)
    assert ("economic_mpc", DEFAULT_ESTIMATOR) in scenario.combinations()
    assert scenario.file.estimators[DEFAULT_ESTIMATOR] == Plugin(use=DEFAULT_ESTIMATOR)
