"""The tree of scenarios: the nominal plan where nothing is uncertain, and a first move for all where something is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.contracts import Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import FloatArray, Model, Stepper
from adaptive_flot.testing import ControllerCase, controller_case
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.scenarios import Misfit, grid
from controllers.economic_mpc.solvers.nlp_solvers import InteriorPoint, make_solver
from controllers.economic_mpc.solvers.real_time_iteration import MOST_STEPS, RealTimeIteration
from controllers.economic_mpc.solvers.verification import NlpSolution, Validity
from controllers.economic_mpc.tree.scenario_tree import ScenarioTree
from controllers.economic_mpc.tree.tree_programme import TreeProgramme
from controllers.economic_mpc.tree.tree_step import TreeStep
from tests.controllers.plan.test_collocation import BOUNDS, HELD, MOVE_S, arguments, cell_problem, cold

COUNT, BRANCH = 3, 4


@pytest.fixture(scope="module")
def problem(model: Model) -> OptimalControlProblem:
    return cell_problem(model, 6)


@pytest.fixture(scope="module")
def tree(problem: OptimalControlProblem) -> ScenarioTree:
    return ScenarioTree(problem, COUNT, BRANCH)


def solved(tree: ScenarioTree, solver: str, each: list[FloatArray], start: FloatArray) -> list[FloatArray]:
    found = InteriorPoint(tree, tree.functions(solver), solver, 20.0)(
        np.concatenate(each), tree.at.bounds(tree.problem.layout.bounds(BOUNDS)), tree.at.joined([start] * tree.count)
    )
    assert found.validity is Validity.VALID, found.message
    return tree.at.split(found.variables)


@pytest.mark.parametrize("solver", ["fatrop", "ipopt"])
def test_equal_scenarios_are_the_nominal_plan(problem: OptimalControlProblem, model: Model, solver: str) -> None:
    """Branches as long as the horizon, told the same as the nominal plan and earning the same, are that plan."""
    start, now = cold(problem, model), arguments(model)
    nominal = make_solver(problem, solver, 10.0)(now, problem.layout.bounds(BOUNDS), start)
    whole = ScenarioTree(problem, COUNT, problem.layout.horizon)
    for plan in solved(whole, solver, [now] * COUNT, start):
        inputs = problem.layout.inputs_of(plan)
        np.testing.assert_allclose(inputs / problem.layout.inputs_of(nominal.variables), 1.0, atol=1e-3)


def test_both_solvers_find_the_same_tree(tree: ScenarioTree, model: Model) -> None:
    """fatrop is told where the stages lie, ipopt is not: a wrong structure would show."""
    each, start = different(model), cold(tree.problem, model)
    plans = [solved(tree, solver, each, start) for solver in ("fatrop", "ipopt")]
    for one, other in zip(*plans, strict=True):
        one, other = tree.problem.layout.inputs_of(one)[:BRANCH], tree.problem.layout.inputs_of(other)[:BRANCH]
        np.testing.assert_allclose(one / other, 1.0, atol=2e-3)


def different(model: Model) -> list[FloatArray]:
    """Arguments of the nominal cell, and of cells with another coalescence and with another grade."""
    theta = model.parameter_values.copy()
    theta[model.index("parameters", "C")] *= 1.05
    return [arguments(model), arguments(model, parameters=theta), arguments(model, biases=np.array([-0.004]))]


def test_scenarios_share_the_first_move_and_keep_states_of_their_own(tree: ScenarioTree, model: Model) -> None:
    """Each branch is what the cell does with its own parameters under its own moves, and keeps its own grade limit."""
    each = different(model)
    plans = solved(tree, "fatrop", each, cold(tree.problem, model))
    inputs = [tree.problem.layout.inputs_of(plan)[:BRANCH] for plan in plans]
    for other in inputs[1:]:
        np.testing.assert_allclose(other[0], inputs[0][0], rtol=1e-6)
        assert np.abs(other[1:] / inputs[0][1:] - 1).max() > 1e-3
    theta = model.parameter_values.copy()
    theta[model.index("parameters", "C")] *= 1.05
    x0 = tree.problem.layout.stages(plans[1])[0, : len(model.states)] * tree.problem.layout.x_scale
    held = np.column_stack([inputs[1][:, 0], np.full(BRANCH, HELD[1]), inputs[1][:, 1]])
    run = Stepper(model, 1.0).simulate(x0, np.repeat(held, int(MOVE_S), axis=0), theta)
    came = run.outputs[int(MOVE_S) - 1 :: int(MOVE_S), model.index("outputs", "concentrate_grade")]
    planned = np.array(tree.problem.outputs(plans[1], each[1])).ravel()[:BRANCH]
    np.testing.assert_allclose(planned, came, rtol=3e-3)
    for plan, told in zip(plans, each, strict=True):
        assert np.array(tree.problem.outputs(plan, told)).ravel()[:BRANCH].min() > 0.2 - 1e-4


def test_the_derivatives_are_those_of_the_problem(tree: ScenarioTree, model: Model) -> None:
    """Jacobian and gradients against CasADi's own, at a point that is no solution."""
    generator = np.random.default_rng(1)
    x = tree.at.joined([cold(tree.problem, model)] * COUNT) * (1 + 0.01 * generator.standard_normal(tree.at.size))
    p, lam = np.concatenate(different(model)), generator.standard_normal(tree.at.rows)
    symbols, of_g = (tree.nlp["x"], tree.nlp["p"]), ca.MX.sym("lam", tree.at.rows)
    ours = tree.functions("fatrop")
    jacobian = ca.Function("J", [*symbols], [ca.jacobian(tree.nlp["g"], symbols[0])])
    g, by_x = ours["nlp_jac_g"](x, p)
    np.testing.assert_allclose(np.array(by_x), np.array(jacobian(x, p)), atol=1e-9)
    np.testing.assert_allclose(np.array(g), np.array(tree.constraints(x, p)), atol=1e-12)
    slope = ca.Function("s", [*symbols, of_g], [ca.gradient(tree.nlp["f"] + ca.dot(of_g, tree.nlp["g"]), symbols[0])])
    np.testing.assert_allclose(np.array(ours["nlp_hess_l"](x, p, 1.0, lam)[0]), np.array(slope(x, p, lam)), atol=1e-8)
    value = ca.Function("f", [*symbols], [ca.gradient(tree.nlp["f"], symbols[0])])
    np.testing.assert_allclose(np.array(ours["nlp_grad_f"](x, p)), np.array(value(x, p)), atol=1e-8)


def followed(tree: ScenarioTree, model: Model) -> tuple[NlpSolution, NlpSolution]:
    """Newton steps and fatrop for a higher limit of the grade, both from the tree of a lower one."""
    bounds, start = tree.at.bounds(tree.problem.layout.bounds(BOUNDS)), tree.at.joined([cold(tree.problem, model)] * 3)
    complete = InteriorPoint(tree, tree.functions("fatrop"), "fatrop", 20.0)
    first = complete(np.concatenate(different(model)), bounds, start)
    theta = model.parameter_values.copy()
    theta[model.index("parameters", "C")] *= 1.05
    higher = [
        {"limits": np.array([0.203])} | more for more in ({}, {"parameters": theta}, {"biases": np.array([-0.004])})
    ]
    now = np.concatenate([arguments(model, **more) for more in higher])
    steps = RealTimeIteration(tree, TreeStep(tree), complete)
    return steps(now, bounds, first.variables, first.multipliers), complete(now, bounds, first.variables)


def test_newton_steps_follow_the_tree_of_a_complete_solver(tree: ScenarioTree, model: Model) -> None:
    ours, theirs = followed(tree, model)
    assert ours.found_by == "rti" and ours.validity is Validity.VALID and 1 <= ours.iterations <= MOST_STEPS
    plans = [tree.at.split(solution.variables)[0] for solution in (ours, theirs)]
    inputs = [tree.problem.layout.inputs_of(plan) for plan in plans]
    assert np.abs(inputs[0] / HELD[[0, 2]] - 1).max() > 0.01
    np.testing.assert_allclose(inputs[0] / inputs[1], 1.0, atol=5e-3)


def test_a_programme_without_slacks_has_the_solution_of_the_one_with_them(
    tree: ScenarioTree, model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, _ = followed(tree, model)
    asked: list[int] = []

    def never(self: TreeProgramme, gradient: FloatArray, *rest: Any) -> None:
        asked.append(len(gradient))

    monkeypatch.setattr(TreeProgramme, "_without_slacks", never)
    theirs, _ = followed(tree, model)
    assert asked
    np.testing.assert_allclose(ours.variables, theirs.variables, atol=5e-3)


def test_the_next_start_is_the_tree_one_move_later(tree: ScenarioTree, model: Model) -> None:
    """Each scenario goes on with its own second move, but for the first move, which is the nominal one's."""
    _, solution = followed(tree, model)
    inputs_of = tree.problem.layout.inputs_of
    before = [inputs_of(plan) for plan in tree.at.split(solution.variables)]
    after = [inputs_of(plan) for plan in tree.at.split(tree.at.shifted(solution.variables))]
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(new[0], before[0][1])
        np.testing.assert_array_equal(new[1 : BRANCH - 1], old[2:BRANCH])
        np.testing.assert_array_equal(new[BRANCH - 1], old[BRANCH - 1] if old is not before[0] else old[BRANCH])


def decided(options: dict[str, Any], std: float) -> tuple[FloatArray, ControllerCase]:
    """Inputs of 35 samples, two optimisations among them; parameters known to `std`, plans as good as they say."""
    case = controller_case(EconomicMpc, horizon=6, solver="fatrop", **options)
    state = case.controller.init(0.0)
    state, _ = case.controller.decide(state, None, None)
    rows = []
    for sample, estimate in zip(case.samples[:35], case.estimates[:35], strict=True):
        covariance = np.diag((std * estimate.parameters) ** 2)
        state, decision = case.controller.decide(state, sample, replace(estimate, covariance=covariance))
        state = replace(state, misfit=Misfit.none(1))
        rows.append(decision.inputs)
    return np.array(rows), case


def test_a_tree_of_one_and_a_tree_without_spread_are_the_nominal_controller_to_the_bit() -> None:
    plain, _ = decided({}, 0.02)
    np.testing.assert_array_equal(decided({"scenarios": 1}, 0.02)[0], plain)
    np.testing.assert_array_equal(decided({"scenarios": 9}, 0.0)[0], plain)


def test_a_spread_holds_the_first_move_back() -> None:
    """Less air than the nominal plan takes where n and C are known to 3 %: air lowers the grade."""
    plain, case = decided({}, 0.03)
    careful, _ = decided({"scenarios": 9}, 0.03)
    air = case.setup.model.index("inputs", "air_flow")
    assert careful[-1, air] < plain[-1, air] - 1e-6


def test_the_first_axis_has_the_spread_of_the_output() -> None:
    """Known answer: the output varies along the first axis by its whole standard deviation, along the others not."""
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    gains, spread = np.array([[0.5, -1.0]]), np.array([0.3])
    found = grid(np.array([1.0, 2.0]), covariance, spread, gains, axes=2, quantile=1.5)
    assert len(found.parameters) == 9 and not found.are_alike
    np.testing.assert_array_equal(found.parameters[0], [1.0, 2.0])
    moved = found.parameters - found.parameters[0]
    outputs = (moved @ gains.T + found.biases).ravel()
    std = np.sqrt(gains[0] @ covariance @ gains[0] + 0.09)
    np.testing.assert_allclose(np.sort(outputs), 1.5 * std * np.repeat([-1.0, 0.0, 1.0], 3), atol=1e-12)


def test_a_scenario_keeps_its_side_from_decision_to_decision() -> None:
    """The plan of the move before is its start: nearly the same covariance gives nearly the same scenarios."""
    generator = np.random.default_rng(5)
    covariance, gains = np.array([[4.0, 1.0], [1.0, 2.0]]), np.array([[0.5, -1.0]])
    first = grid(np.zeros(2), covariance, np.array([0.3]), gains, axes=3, quantile=1.0)
    for _ in range(20):
        near = covariance * (1 + 1e-3 * generator.standard_normal()), gains * (1 + 1e-3 * generator.standard_normal())
        again = grid(np.zeros(2), near[0], np.array([0.3]), near[1], axes=3, quantile=1.0)
        np.testing.assert_allclose(again.parameters, first.parameters, atol=0.05)
        np.testing.assert_allclose(again.biases, first.biases, atol=0.05)


def test_three_axes_of_three_quantities_have_their_whole_covariance() -> None:
    """The outer points of each axis, one standard deviation away, add up to the covariance."""
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    found = grid(np.zeros(2), covariance, np.array([0.3]), np.array([[0.5, -1.0]]), axes=3, quantile=1.0)
    axes = np.hstack([found.parameters, found.biases])[1:7:2]
    expected = np.zeros((3, 3))
    expected[:2, :2], expected[2, 2] = covariance, 0.09
    np.testing.assert_allclose(axes.T @ axes, expected, atol=1e-12)


def test_a_factor_agrees_with_a_change_where_it_is_small_and_stays_positive_where_it_is_not() -> None:
    theta, gains, spread = np.array([1.0, 2e-4]), np.array([[0.5, -1e3]]), np.array([1e-3])
    std = np.diag([0.15, 0.8 * 2e-4])
    covariance = std @ np.array([[1.0, -0.99], [-0.99, 1.0]]) @ std
    for share, tolerance in ((1e-4, 1e-6), (1.0, 1e9)):
        linear, factor = (
            grid(theta, share**2 * covariance, spread, gains, 2, 1.645, which) for which in ((), (False, True))
        )
        np.testing.assert_array_equal(factor.parameters[0], theta)
        np.testing.assert_array_equal(factor.parameters[:, 0], linear.parameters[:, 0])
        np.testing.assert_allclose(factor.parameters[:, 1], linear.parameters[:, 1], rtol=tolerance)
    assert linear.parameters[:, 1].min() < 0 < factor.parameters[:, 1].min()


def test_a_wide_covariance_along_the_ridge_has_a_plan_for_every_scenario() -> None:
    """As `adaptive_imm` has it where the model is wrong; scenarios along a straight line in C would be unsolvable."""
    case = controller_case(EconomicMpc, horizon=6, solver="fatrop", scenarios=9)
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    std = np.diag(case.estimates[0].parameters * [0.16, 0.82])
    wide = replace(case.estimates[0], covariance=std @ np.array([[1.0, -0.9996], [-0.9996, 1.0]]) @ std)
    state, _ = controller.decide(controller.init(0.0), None, None)
    state, decision = controller.decide(state, case.samples[0], wide)
    assert decision.status is Status.OK and state.tree is not None


def test_a_misfit_is_the_mean_square_of_what_came_less_what_was_planned() -> None:
    misfit = Misfit.none(1)
    errors = [0.002, -0.001, 0.004]
    for k, error in enumerate(errors):
        misfit = replace(misfit, expected=(30.0 * k, (0.2,)))
        assert misfit.after(30.0 * k - 1.0, np.array([0.5]), 1.0) == misfit  # not yet
        misfit = misfit.after(30.0 * k, np.array([0.2 + error]), 1.0)
    assert misfit.variance[0] == pytest.approx(np.mean(np.square(errors))) and misfit.count == 3
    silent = replace(misfit, expected=(90.0, (0.2,))).after(90.0, np.array([np.nan]), 1.0)
    assert silent.variance == misfit.variance and silent.expected is None


def test_a_drill_of_a_failing_solver_goes_on_with_the_plan() -> None:
    """The tree finds nothing either: the plan of the step before goes on, as without scenarios."""
    case = controller_case(EconomicMpc, horizon=6, solver="fatrop", scenarios=3)
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    state, _ = controller.decide(controller.init(0.0), None, None)
    state, first = controller.decide(state, case.samples[0], case.estimates[0])
    assert first.status is Status.OK and state.tree is not None
    late = replace(case.samples[0], time=case.samples[0].time + 30.0)
    _, decision = controller.with_failing_solver().decide(state, late, case.estimates[0])
    assert decision.status is Status.SHIFTED_PLAN
    _, decision = controller.decide(state, late, case.estimates[0])
    assert decision.status is Status.OK


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenarios": 5}, "give 1, 3, 9 or 27"),
        ({"scenarios": 3, "branch": 7}, "give 1 to 6"),
        ({"scenarios": 3, "probing": {}}, "not both"),
    ],
)
def test_an_option_out_of_range_is_a_named_error(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        controller_case(EconomicMpc, horizon=6, **options)
