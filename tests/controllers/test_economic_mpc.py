"""The controller applies only inputs it has checked, and says who decided."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import ControllerSetup, Decision, Status, full_parameters
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Stepper
from adaptive_flot.testing import ControllerCase, controller_case
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.solvers.verification import NlpSolution, Validity
from controllers.economic_mpc.state import MpcState


@pytest.fixture(scope="module")
def case() -> ControllerCase:
    return controller_case(EconomicMpc, horizon=6, solver="fatrop")


def run(case: ControllerCase, state: MpcState, rows: slice) -> tuple[MpcState, list[Decision]]:
    decisions = []
    for sample, estimate in zip(case.samples[rows], case.estimates[rows], strict=True):
        state, decision = case.controller.decide(state, sample, estimate)
        decisions.append(decision)
    return state, decisions


def start(case: ControllerCase) -> MpcState:
    state: MpcState = case.controller.init(0.0)
    state, decision = case.controller.decide(state, None, None)
    assert decision.decided_by == "schedule"
    return state


def broken(message: str) -> Any:
    def solve(arguments: Any, bounds: Any, first: Any, multipliers: Any = None) -> NlpSolution:
        bad = np.full(len(first), np.nan)
        return NlpSolution(bad, (bad, np.full(len(bounds["lbg"]), np.nan)), Validity.NOT_FINITE, message, 0, 0.001)

    return solve


def test_it_optimises_every_move_and_holds_between(case: ControllerCase) -> None:
    _, decisions = run(case, start(case), slice(0, 35))
    solved = [k for k, d in enumerate(decisions) if np.isfinite(d.solve_seconds)]
    assert solved == [0, 30]
    assert all(d.status is Status.OK and d.decided_by == "economic_mpc" for d in decisions)
    assert all(np.array_equal(d.inputs, decisions[0].inputs) for d in decisions[:30])


def test_a_decision_tells_its_plan(case: ControllerCase) -> None:
    """Ends of the moves, inputs of which the first is applied, and the grade that the model gives for them."""
    _, (decision, between) = run(case, start(case), slice(0, 2))
    plan, model = decision.plan, case.setup.model
    assert plan is not None and between.plan is None
    assert plan.time.tolist() == [case.samples[0].time + 30.0 * k for k in range(1, 7)]
    held = np.tile(decision.inputs, (6, 1))
    held[:, model.index("inputs", "air_flow")] = plan.inputs["air_flow"]
    held[:, model.index("inputs", "level_setpoint")] = plan.inputs["level_setpoint"]
    np.testing.assert_allclose(held[0], decision.inputs, rtol=1e-3)
    estimate = case.estimates[0]
    theta = full_parameters(model, case.setup.parameters, estimate.parameters)
    run_ahead = Stepper(model, 1.0).simulate(estimate.state, np.repeat(held, 30, axis=0), theta)
    np.testing.assert_allclose(plan.outputs["concentrate_grade"], run_ahead.outputs[29::30, 0], rtol=3e-3)


def test_a_failed_solve_plays_the_plan_then_holds(case: ControllerCase, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cold retry, then the shifted plan move by move, then hold; the loop never stops and says why."""
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    state, _ = run(case, start(case), slice(0, 1))
    assert state.plan is not None
    planned = controller.layout.inputs_of(state.plan)
    monkeypatch.setattr(controller, "solver", broken("no luck"))
    low, high = controller._bounds.inputs.T
    before = np.empty(3)
    for k in range(1, 8):
        sample = replace(case.samples[0], time=1.0 + 30.0 * k)
        state, decision = controller.decide(state, sample, case.estimates[0])
        assert decision.message == "no luck" and np.isfinite(decision.inputs).all()
        if k < 6:
            assert decision.status is Status.SHIFTED_PLAN
            np.testing.assert_allclose(decision.inputs[controller.layout.moved], np.clip(planned[k], low, high))
        else:
            assert decision.status is Status.HELD
            np.testing.assert_array_equal(decision.inputs, before)
        before = decision.inputs
    monkeypatch.undo()
    sample = replace(case.samples[0], time=1.0 + 30.0 * 8)
    _, decision = controller.decide(state, sample, case.estimates[0])
    assert decision.status is Status.OK  # the first good solve takes over again


def test_without_a_plan_it_holds_and_without_finite_inputs_it_is_safe(
    case: ControllerCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    monkeypatch.setattr(controller, "solver", broken("no luck"))
    state = start(case)
    _, decision = controller.decide(state, case.samples[0], case.estimates[0])
    assert decision.status is Status.HELD
    lost = replace(state, inputs=np.full(3, np.nan))
    _, decision = controller.decide(lost, case.samples[0], case.estimates[0])
    assert decision.status is Status.SAFE_INPUT and decision.decided_by == "safe_input"
    np.testing.assert_array_equal(decision.inputs, case.setup.schedule[0])


@pytest.mark.parametrize(("share", "tries"), [(0.9, 2), (1.1, 1)])
def test_a_second_try_is_made_within_the_budget_only(
    case: ControllerCase, monkeypatch: pytest.MonkeyPatch, share: float, tries: int
) -> None:
    """A warm start that fails is followed by a cold one, unless it used up the time of the step."""
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    state, _ = run(case, start(case), slice(0, 1))
    took, calls, fails = share * controller.budget_s, [], broken("no luck")

    def solve(*given: Any) -> NlpSolution:
        calls.append(given)
        failed: NlpSolution = fails(*given)
        return replace(failed, seconds=took)

    monkeypatch.setattr(controller, "solver", solve)
    _, decision = controller.decide(state, replace(case.samples[0], time=31.0), case.estimates[0])
    assert len(calls) == tries and decision.status is Status.SHIFTED_PLAN


def test_ipopt_stops_where_its_time_is_up(case: ControllerCase) -> None:
    """At its start: to hold the inputs in a cell at rest is a plan that meets the constraints, so it is applied."""
    hurried = controller_case(EconomicMpc, horizon=6, solver="ipopt", budget_s=1e-6)
    state = hurried.controller.decide(hurried.controller.init(0.0), None, None)[0]
    _, decision = hurried.controller.decide(state, case.samples[0], case.estimates[0])
    _, free = run(case, start(case), slice(0, 1))
    assert decision.status is Status.OK and decision.plan is not None and free[0].plan is not None
    planned, held = decision.plan.inputs["level_setpoint"], case.samples[0].inputs[2]
    np.testing.assert_allclose(planned, held, rtol=1e-3)
    assert np.abs(free[0].plan.inputs["level_setpoint"] / held - 1).max() > 0.02


def test_a_state_that_is_not_finite_does_not_poison_the_next_step(case: ControllerCase) -> None:
    """After one NaN estimate the controller decides as one that never saw it (from the same plan)."""
    state, _ = run(case, start(case), slice(0, 1))
    sick = replace(case.estimates[0], state=np.full(9, np.nan))
    late = replace(case.samples[0], time=31.0)
    after, decision = case.controller.decide(state, late, sick)
    assert decision.status is Status.SHIFTED_PLAN and np.isfinite(decision.inputs).all()
    _, recovered = case.controller.decide(after, replace(late, time=61.0), case.estimates[0])
    assert recovered.status is Status.OK and np.isfinite(recovered.inputs).all()


def test_a_biased_model_is_corrected(case: ControllerCase) -> None:
    """Grade measured 0.02 below the prediction: the controller backs off with less air than without."""
    estimates = [replace(e, innovation=np.full_like(e.innovation, -0.02)) for e in case.estimates]
    _, plain = run(case, start(case), slice(0, 31))
    state = start(case)
    for sample, estimate in zip(case.samples[:31], estimates[:31], strict=True):
        state, decision = case.controller.decide(state, sample, estimate)
    assert state.bias[0] == pytest.approx(-0.02, rel=0.25)
    assert decision.inputs[0] < plain[-1].inputs[0]


def test_it_wants_limits_and_prices(case: ControllerCase) -> None:
    bare = ControllerSetup(case.setup.model, 1.0, case.setup.schedule)
    with pytest.raises(ModelError, match="limits"):
        EconomicMpc(bare)
    assert case.setup.limits is not None
    limits = case.setup.limits
    for lacking in (
        replace(limits, inputs={"air_flow": limits.inputs["air_flow"]}),
        replace(limits, moves={"air_flow": limits.moves["air_flow"]}),
        replace(limits, inputs={}, moves={}),
    ):
        with pytest.raises(ModelError, match="give both for each input that is to be moved"):
            EconomicMpc(replace(case.setup, limits=lacking))
    with pytest.raises(ModelError, match="did you mean 'ipopt'"):
        EconomicMpc(case.setup, solver="ipot")
    with pytest.raises(ModelError, match="positive"):
        EconomicMpc(case.setup, horizon=0)


def test_a_level_out_of_its_range_is_brought_back(case: ControllerCase) -> None:
    """A drop of the feed pulls the level below its range; the plan goes as far beyond as it must, and says so."""
    model = case.setup.model
    low = case.estimates[0].state.copy()
    low[model.index("states", "level")] = 0.316
    drop = replace(case.samples[0], inputs=case.samples[0].inputs * np.array([1.0, 0.67, 1.0]))
    _, decision = case.controller.decide(start(case), drop, replace(case.estimates[0], state=low))
    assert decision.status is Status.SOFTENED and decision.plan is not None and list(decision.softened) == ["level"]
    held = np.tile(decision.inputs, (6, 1))
    held[:, model.index("inputs", "air_flow")] = decision.plan.inputs["air_flow"]
    held[:, model.index("inputs", "level_setpoint")] = decision.plan.inputs["level_setpoint"]
    levels = Stepper(model, 1.0).simulate(low, np.repeat(held, 30, axis=0), model.parameter_values).states
    assert levels[-1, model.index("states", "level")] > 0.33


def test_disturbances_are_those_of_the_newest_sample(case: ControllerCase) -> None:
    """Feed flow and feed grade as they are measured now, not as they were when the controller took over."""
    state, _ = run(case, start(case), slice(0, 1))
    model = case.setup.model
    p = model.parameter_values
    p[model.index("parameters", "feed_concentration.chalcopyrite")] *= 0.7
    late = replace(case.samples[0], time=31.0)
    _, same = case.controller.decide(state, late, case.estimates[0])
    _, poor = case.controller.decide(state, replace(late, parameters=p), case.estimates[0])
    _, less = case.controller.decide(state, replace(late, inputs=late.inputs * [1.0, 0.8, 1.0]), case.estimates[0])
    assert poor.inputs[0] < same.inputs[0]  # a poorer feed wants less air for the same grade
    assert less.inputs[1] == pytest.approx(0.8 * same.inputs[1]) and less.inputs[0] != same.inputs[0]
