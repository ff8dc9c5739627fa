"""Limits that no plan keeps are given up in the stated order, by as little as can be, and the decision says so."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Decision, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.report.run.control.softened import softened_table
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.results.timeseries import SOFTENED
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.testing import ControllerCase, controller_case
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.solvers.newton_step import PlanStep
from controllers.economic_mpc.solvers.nlp_solvers import interior_point
from controllers.economic_mpc.solvers.real_time_iteration import RealTimeIteration
from controllers.economic_mpc.solvers.verification import Validity
from controllers.economic_mpc.state import MpcState

LOW_GRADE, LOW_LEVEL = -0.06, 0.30
"""Bias of the grade, and a level [m], that no plan can make good within the first move."""


def make(**options: Any) -> ControllerCase:
    return controller_case(EconomicMpc, horizon=6, solver="fatrop", **options)


@pytest.fixture(scope="module")
def case() -> ControllerCase:
    return make()


def decided(
    case: ControllerCase, *, bias: float = 0.0, level: float | None = None, air: float | None = None
) -> tuple[EconomicMpc, MpcState, Decision]:
    """First decision with a bias of the grade, from a level, and from an air flow."""
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    state = controller.init(0.0)
    held = case.samples[0].inputs.copy()
    if air is not None:
        held[case.setup.model.index("inputs", "air_flow")] = air
    x = case.estimates[0].state.copy()
    if level is not None:
        x[case.setup.model.index("states", "level")] = level
    silent = np.full_like(case.estimates[0].innovation, np.nan)
    state, decision = controller.decide(
        replace(state, bias=(bias,), inputs=held),
        replace(case.samples[0], inputs=held),
        replace(case.estimates[0], innovation=silent, state=x),
    )
    return controller, state, decision


def slacks(controller: EconomicMpc, state: MpcState) -> np.ndarray:
    """Slack of the grade limit and of the level range (horizon, 2)."""
    assert state.plan is not None
    begin = controller.layout.chosen.start + controller.layout.inputs_size
    return np.abs(controller.layout.stages(state.plan)[:, begin : begin + 2])


def test_a_plan_that_keeps_every_limit_says_nothing(case: ControllerCase) -> None:
    _, _, decision = decided(case)
    assert decision.status is Status.OK and decision.message == "" and not decision.softened


def test_a_grade_that_can_not_be_kept_is_told_with_its_size(case: ControllerCase) -> None:
    """The excess is that of the plan's own worst grade, which is at the first collocation point or later."""
    _, _, decision = decided(case, bias=LOW_GRADE)
    assert decision.status is Status.SOFTENED and decision.decided_by == "economic_mpc"
    assert list(decision.softened) == ["concentrate_grade"] and decision.plan is not None
    at_ends = 0.20 - decision.plan.outputs["concentrate_grade"].min()
    assert decision.softened["concentrate_grade"] >= at_ends - 1e-4
    assert (
        decision.message
        == f"given up: lower limit of concentrate_grade by {decision.softened['concentrate_grade']:.3g}"
    )


def test_the_excess_is_the_least_there_is(case: ControllerCase) -> None:
    """Of all sums: as one that is made for the grade at a hundred times its price."""
    dear = make(limit_penalty=0.1)
    ours, theirs = (slacks(*decided(c, bias=LOW_GRADE)[:2])[:, 0].sum() for c in (case, dear))
    assert ours > 1.0
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


def test_the_order_decides_which_limit_is_exceeded_further() -> None:
    """The same state under both orders: the one named first is exceeded less than where it is named last."""
    found = {}
    for first, last in (("concentrate_grade", "level"), ("level", "concentrate_grade")):
        controller, state, decision = decided(make(priority=[first, last]), bias=LOW_GRADE, level=LOW_LEVEL)
        assert decision.status is Status.SOFTENED and set(decision.softened) == {"concentrate_grade", "level"}
        found[first] = slacks(controller, state).sum(axis=0)
    assert found["concentrate_grade"][0] < found["level"][0] - 0.01
    assert found["level"][1] < found["concentrate_grade"][1] - 0.01


def test_an_input_outside_its_range_comes_back_at_once(case: ControllerCase) -> None:
    """The range of an input is never given up, so its largest move is: by exactly what is missing."""
    _, _, decision = decided(case, air=2.6e-3)
    air = case.setup.model.index("inputs", "air_flow")
    assert 0.99 * 2.17e-3 < decision.inputs[air] <= 2.17e-3
    assert decision.status is Status.SOFTENED
    assert decision.softened["air_flow"] == pytest.approx(2.6e-3 - 2.17e-3 - 2e-4)
    assert "largest move of air_flow by 0.00023 m3/s" in decision.message


def test_a_further_solve_that_fails_leaves_the_plan_and_says_so(
    case: ControllerCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    monkeypatch.setattr(controller.planner.softening, "solver", controller.with_failing_solver().solver)
    _, _, decision = decided(case, bias=LOW_GRADE)
    assert decision.status is Status.SOFTENED and decision.plan is not None
    assert decision.softened["concentrate_grade"] > 0.01
    assert decision.message.endswith("not in the stated order, since a further solve failed")


@pytest.mark.parametrize("level", [None, LOW_LEVEL])
def test_newton_steps_give_up_what_a_complete_solver_does(monkeypatch: pytest.MonkeyPatch, level: float | None) -> None:
    """The plans of the stated order, found without ipopt, against those of ipopt."""
    ours = make()
    controller, state, _ = decided(ours, bias=LOW_GRADE, level=level)
    theirs = make()
    assert isinstance(theirs.controller, EconomicMpc)
    ipopt = interior_point(theirs.controller.problem, "ipopt", 5.0)
    monkeypatch.setattr(theirs.controller.planner.softening, "solver", lambda *given: ipopt(*given[:3]))
    _, other, _ = decided(theirs, bias=LOW_GRADE, level=level)
    assert state.plan is not None and other.plan is not None
    inputs = [controller.layout.inputs_of(plan) for plan in (state.plan, other.plan)]
    np.testing.assert_allclose(inputs[0], inputs[1], rtol=2e-3)
    np.testing.assert_allclose(slacks(controller, state), slacks(controller, other), atol=2e-3)


def test_steps_that_do_not_come_to_the_optimum_are_followed_by_a_complete_solver(case: ControllerCase) -> None:
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    start, planner = decided(case)[1], controller.planner
    assert start.plan is not None and start.multipliers is not None
    steps = RealTimeIteration(controller.problem, PlanStep(controller.problem), controller.solver, until=0.0)
    bounds = controller.layout.bounds(planner.softening.bounds)
    found = steps(np.full_like(case.estimates[0].state, np.nan), bounds, start.plan, start.multipliers)
    assert found.validity is not Validity.VALID
    arguments = planner.find(
        controller.solver, start, case.samples[0].inputs, case.samples[0], case.estimates[0]
    ).arguments
    assert steps(arguments, bounds, start.plan, start.multipliers).found_by == "fatrop"


@pytest.mark.parametrize("priority", [["level"], ["level", "level"], ["level", "recovery"]])
def test_a_priority_names_each_limit_once(priority: list[str]) -> None:
    with pytest.raises(ModelError, match="give each limited output and state once"):
        make(priority=priority)


def test_table_and_report_tell_what_was_given_up() -> None:
    """A minute of closed loop with a grade limit that the cell can not reach."""
    scenario = load_scenario("closed_loop_drift")
    mpc = scenario.file.controllers["economic_mpc"].model_copy(update={"options": {"solver": "fatrop", "horizon": 4}})
    assert scenario.file.limits is not None
    limits = scenario.file.limits.model_copy(update={"concentrate_grade": 0.5})
    controllers = {**scenario.file.controllers, "economic_mpc": mpc}
    file = scenario.file.model_copy(update={"duration_s": 360.0, "controllers": controllers, "limits": limits})
    (run,) = run_scenario(replace(scenario, file=file), ["fixed"], [1], controllers=["economic_mpc"])
    column = run.table[f"{SOFTENED}concentrate_grade"]
    solved = run.table["solve_seconds"].notna()
    assert column[solved].gt(0.1).all() and column[~solved].isna().all()
    table = softened_table(scenario.model, [run])
    assert table is not None
    ((controller, estimator, seed, limit, first, times, by),) = table.rows
    assert (controller, estimator, seed, limit, first) == ("economic_mpc", "fixed", "1", "concentrate_grade", "302")
    assert int(times) == int(solved.sum()) and float(by) == pytest.approx(column.max(), rel=1e-2)
    assert softened_table(scenario.model, []) is None
