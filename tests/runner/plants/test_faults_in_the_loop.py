"""All faults at once in a closed loop: it keeps running within its limits, and the report counts what happened."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
import yaml

from adaptive_flot.contracts import Decision, Estimate, Sample, Status
from adaptive_flot.errors import ScenarioError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.run.control.unsolved import unsolved_table
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.plants.fault_injection import with_controller_faults, with_plant_faults
from adaptive_flot.runner.plants.scenario_plant import make_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.state import MpcState
from controllers.hold import Hold
from tests.runner.conftest import WriteScenario

WINDOWS: dict[str, dict[str, float | None]] = {
    "missing": {"from_s": 310, "to_s": 330},
    "outliers": {"from_s": 310, "to_s": 330, "rate": 0.3},
    "frozen": {"from_s": 332, "to_s": 341},
    "stuck": {"from_s": 352, "to_s": 366},
    "solver_failure": {"from_s": 395, "to_s": 455},
    "nan_state": {"from_s": 481, "to_s": 482},
    "slow_analyser": {"from_s": 485, "every_s": 10, "dead_time_s": 7},
}


@dataclass(frozen=True)
class Solve:
    """An optimisation of the economic MPC in the loop: who did it, from what, and what came of it."""

    controller: EconomicMpc
    state: MpcState
    held: FloatArray
    sample: Sample
    estimate: Estimate
    decision: Decision


@pytest.fixture(scope="module")
def solves() -> list[Solve]:
    """Filled by `runs`."""
    return []


@pytest.fixture(scope="module")
def runs(solves: list[Solve]) -> Iterator[list[Run]]:
    """The shipped scenario with its faults pressed into 220 s."""
    plain = EconomicMpc._optimise

    def recorded(
        self: EconomicMpc,
        state: MpcState,
        held: FloatArray,
        sample: Sample,
        estimate: Estimate,
        bounds: dict[str, FloatArray] | None,
    ) -> tuple[MpcState, Decision]:
        after, decision = plain(self, state, held, sample, estimate, bounds)
        solves.append(Solve(self, state, held, sample, estimate, decision))
        return after, decision

    scenario = load_scenario("faults")
    faults = [f.model_copy(update=WINDOWS[f.fault]) for f in scenario.file.faults]
    cases = [
        c
        for c in scenario.file.cases
        if (c.controller, c.estimator) in (("economic_mpc", "adaptive_imm"), ("pi", "fixed"))
    ]
    file = scenario.file.model_copy(update={"duration_s": 520.0, "faults": faults, "cases": cases})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EconomicMpc, "_optimise", recorded)
        yield run_scenario(replace(scenario, file=file), seeds=[1])


def test_the_loop_runs_on_within_its_limits_and_counts_what_happened(runs: list[Run]) -> None:
    """Every kind acts; inputs stay finite and in range; counts, fallbacks and true flows are in table and summary."""
    for run in runs:
        late = run.table[run.table["time_s"] > 302]
        assert late["air_flow_m3_s"].between(9.05e-4, 2.17e-3).all()
        assert late["level_setpoint_m"].between(0.33, 0.42).all()
        assert np.isfinite(late[["concentrate_grade_true", "n_estimate", "C_estimate"]].to_numpy()).all()

        named = Counter(name for text in run.table["faults"] for name in text.split("; ") if name)
        assert run.fault_counts == dict(named) and run.summary()["fault_counts"] == run.fault_counts
        expected = set(WINDOWS) - ({"solver_failure"} if run.controller == "pi" else set())
        assert {name.split()[0] for name in run.fault_counts} == expected

        stuck = run.table["faults"].str.contains("stuck air_flow")
        true, asked = run.table["air_flow_m3_s_true"], run.table["air_flow_m3_s"]
        assert true[stuck].nunique() == 1 and stuck.sum() == 14
        np.testing.assert_array_equal(true[~stuck], asked[~stuck])
        if run.controller == "economic_mpc":
            failed = run.table["faults"].str.contains("solver_failure|nan_state")
            assert run.table["control_status"][failed].tolist() == ["shifted_plan"] * 3
            assert run.table["control_status"].iloc[-1] == "ok"


def test_what_was_wrong_with_a_failed_solve_is_told(runs: list[Run]) -> None:
    """In the table of the run, and once for each who decided then in report and on the command line."""
    found = unsolved_table(runs)
    assert found is not None
    rows = [(row[0], *row[3:]) for row in found.rows]
    assert rows == [
        ("economic_mpc", "shifted_plan", "422", "2", "the solver was made to fail"),
        ("economic_mpc", "shifted_plan", "482", "1", "state or estimate is not finite"),
    ]
    assert unsolved_table(runs[1:]) is None


def test_after_every_fault_it_decides_as_a_fresh_controller(runs: list[Run], solves: list[Solve]) -> None:
    """Also after missing, outlying, frozen and delayed values and a stuck valve: a controller that starts now, is told
    the same and knows the inputs held and the bias of the grade finds the same inputs, to the solver's tolerance."""
    assert len(runs) == 2 and len(solves) == 8
    valid = [s for s in solves if s.decision.status is Status.OK]
    assert [s.sample.time for s in valid] == [301, 331, 361, 391, 511]
    for solve in valid:
        fresh = EconomicMpc(solve.controller.setup, solver="fatrop")
        state = replace(fresh.init(solve.sample.time), inputs=solve.state.inputs, bias=solve.state.bias)
        _, expected = fresh._optimise(state, solve.held, solve.sample, solve.estimate, None)
        assert expected.status is Status.OK
        np.testing.assert_allclose(solve.decision.inputs, expected.inputs, rtol=1e-3)


def test_without_faults_nothing_is_put_between(write_scenario: WriteScenario) -> None:
    scenario = load_scenario(write_scenario())
    realisation, controller = Realisation(scenario, 1), object.__new__(Hold)
    plant = make_plant(realisation)
    assert with_plant_faults(realisation, plant) is plant
    assert with_controller_faults(scenario, controller) is controller


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{fault: mising, output: level}", "did you mean 'missing'"),
        ("{output: level}", "key 'fault' is missing"),
        ("{fault: outliers, output: level, rates: 0.1, size: 1}", "did you mean 'rate'"),
        ("{fault: outliers, output: level, rate: 2, size: 1}", r"faults.0.outliers.rate: .* less than or equal to 1"),
        ("{fault: missing, output: levl}", "output 'levl' is not measured; did you mean 'level'"),
        ("{fault: frozen, output: level, from_s: 9, to_s: 9}", "to_s must lie after from_s"),
        ("{fault: frozen, output: level, from_s: 999}", "is not before the end"),
        ("{fault: stuck, input: air_flow}", "did you mean 'air_flow_m3_s'"),
        ("{fault: slow_analyser, output: level, every_s: 0}", "greater than 0"),
    ],
)
def test_a_wrong_fault_is_one_clear_line(write_scenario: WriteScenario, entry: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        load_scenario(write_scenario({"faults": [yaml.safe_load(entry)]}))
    assert "\n" not in str(caught.value)
