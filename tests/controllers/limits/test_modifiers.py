"""Modifier adaptation: nothing where the model is right, the plant's best point where its slopes are wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import ControllerSetup, Estimate, Limits, OperatingPoint, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import FloatArray, Model, Stepper, steady_state
from adaptive_flot.processes.cascaded_tanks import PumpingEconomics, make_model
from adaptive_flot.processes.flotation.economics import Prices
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.modifiers.slopes import SlopeSums
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.stage import OutputModifiers
from controllers.economic_mpc.solvers.nlp_solvers import SOLVERS, make_solver
from controllers.economic_mpc.taking_over import with_further_states
from estimators.fixed import Fixed
from tests.controllers.plan.test_collocation import BOUNDS, HORIZON, LIMITS, MOVE_S, arguments, cell_problem, cold

DT, START = 5.0, 1.5
"""Sampling interval [s] and pump voltage at the start [V]."""


def mpc(level: tuple[float, float] = (0.0, np.inf), **options: Any) -> EconomicMpc:
    """Of the cascaded tanks; the horizon is that of `test_other_process.py`."""
    limits = Limits(
        outputs={"level": level},
        inputs={"pump_voltage": (0.0, 5.0)},
        moves={"pump_voltage": 0.5},
        states={"upper_level": (0.0, 20.0)},
    )
    setup = ControllerSetup(make_model(), DT, np.array([[START]]), ("upper_outflow",), limits, PumpingEconomics())
    chosen: dict[str, Any] = {"horizon": 32, "move_s": 30.0, "solver": "fatrop"} | options
    return EconomicMpc(setup, **chosen)


def plant(hole: float) -> tuple[Model, float]:
    """Tanks with another lower hole, nominally 0.05, and their best voltage at rest."""
    return make_model().with_parameters({"lower_outflow": hole}), 2 * (0.05 / hole) ** 2 / (3 * 0.25)


def closed_loop(
    controller: EconomicMpc, tanks: Model, rows: int, *, missing: slice = slice(0)
) -> tuple[FloatArray, FloatArray, float]:
    """Level and voltage (rows,) and what was earned [cu]; noise of 0.05 V, and no samples in the rows of `missing`."""
    model, economics, noise = make_model(), PumpingEconomics(), np.random.default_rng(1).normal(0, 0.05, rows)
    x = steady_state(tanks, np.array([START])).state
    estimator = Fixed(Setup(model, DT, ("upper_outflow",), ("level",)))
    belief = estimator.init(Prior(0.0, x, np.array([0.05]), np.eye(1), np.array([0.05])))
    step, levels, voltages, value = Stepper(tanks, DT).call, [], [], 0.0
    state, decision = controller.decide(controller.init(0.0), None, None)
    for k in range(rows):
        u = decision.inputs
        x, y, _ = step(x, DT * k, u, tanks.parameter_values)
        seen = np.full(1, np.nan) if k in range(rows)[missing] else y + noise[k]
        sample = Sample(DT * (k + 1), u, seen)
        belief, estimate = estimator.update(belief, sample)
        state, decision = controller.decide(state, sample, estimate)
        assert decision.status in (Status.OK, Status.SOFTENED)
        rates = economics.rates(OperatingPoint(tanks, x, u, y, tanks.parameter_values), economics.prices())
        levels.append(float(y[0]))
        voltages.append(float(u[0]))
        value += DT * float(sum(rates.values()))
    return np.array(levels), np.array(voltages), value


@pytest.mark.parametrize("hole", [0.045, 0.055])
def test_it_rests_near_the_best_point_of_the_plant(hole: float) -> None:
    """Known answer: the best voltage of the plant is 3.29 and 2.20 V, that of the model 2.67 V."""
    tanks, best = plant(hole)
    _, plain, without = closed_loop(mpc(), tanks, 1800)
    _, found, value = closed_loop(mpc(modifiers=True), tanks, 1800)
    np.testing.assert_allclose(plain[-60:], 2.667, rtol=0.02)
    np.testing.assert_allclose(found[-60:], best, rtol=0.1)
    assert value > 1.03 * without


def test_it_changes_nothing_where_the_model_is_right() -> None:
    """The same voltage to a hundredth, and the same value, with noise."""
    tanks, best = plant(0.05)
    _, plain, without = closed_loop(mpc(), tanks, 700)
    _, found, value = closed_loop(mpc(modifiers=True), tanks, 700)
    np.testing.assert_allclose(found[-60:], best, rtol=0.02)
    np.testing.assert_allclose(found, plain, rtol=0.05)
    assert value == pytest.approx(without, rel=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_limit_holds(solver: str) -> None:
    """The best level of this plant is 13 V, the limit 5 V; slopes are off by a quarter."""
    tanks, _ = plant(0.045)
    level, _, _ = closed_loop(mpc((0.0, 5.0), solver=solver, horizon=20, modifiers=True), tanks, 400)
    assert level.max() < 5.15
    np.testing.assert_allclose(level[-60:], 5.0, atol=0.06)


def test_a_tree_takes_modifiers() -> None:
    """Three scenarios: the level limit is kept, and less of it is used."""
    tanks, _ = plant(0.045)
    level, _, _ = closed_loop(mpc((0.0, 5.0), horizon=12, modifiers=True, scenarios=3), tanks, 300)
    assert level.max() < 5.05
    assert level[-60:].min() > 4.5


def test_missing_samples_are_no_slope() -> None:
    """An hour in, ten minutes without samples: the loop goes on, and comes to the same place."""
    tanks, best = plant(0.055)
    _, found, _ = closed_loop(mpc(modifiers=True), tanks, 900, missing=slice(400, 520))
    np.testing.assert_allclose(found[-60:], best, rtol=0.1)


@pytest.mark.parametrize("solver", SOLVERS)
def test_modifiers_of_zero_give_the_plan_without_them(model: Model, solver: str) -> None:
    """By reduction: the same moves as the problem that has none. And slopes that are not zero change them."""
    plain = cell_problem(model)
    with_them = OptimalControlProblem(model, Prices(), LIMITS, HORIZON, MOVE_S, answer_s=100.0)
    m, ny = plain.layout.inputs_size, len(model.outputs)
    none = OutputModifiers(np.zeros(ny), np.zeros((ny, m)), np.array([1.5e-3, 0.38]))
    grade = model.index("outputs", "concentrate_grade")
    steeper = np.zeros((ny, m))
    steeper[grade, 0] = -60.0
    moves = []
    for problem, modifiers in (
        (plain, None),
        (with_them, none),
        (with_them, OutputModifiers(np.zeros(ny), steeper, np.array([1.5e-3, 0.38]))),
    ):
        now = arguments(model, modifiers=modifiers)
        found = make_solver(problem, solver, 10.0)(now, problem.layout.bounds(BOUNDS), cold(problem, model))
        moves.append(problem.layout.inputs_of(found.variables) / problem.layout.u_scale)
    np.testing.assert_allclose(moves[1], moves[0], rtol=1e-4)
    assert np.abs(moves[2] - moves[0]).max() > 0.01


@given(seed=st.integers(0, 10**6), outputs=st.integers(1, 3), inputs=st.integers(1, 3))
def test_slopes_are_those_of_least_squares_where_much_is_known(seed: int, outputs: int, inputs: int) -> None:
    """Against `numpy.linalg.lstsq`, with a wide prior; one output is not measured, and has no slope."""
    generator = np.random.default_rng(seed)
    truth, drift = generator.normal(size=(outputs, inputs)), generator.normal(0, 0.1, outputs)
    changes = generator.normal(size=(200, inputs))
    errors = changes @ truth.T + drift + generator.normal(0, 0.01, (200, outputs))
    sums = SlopeSums.none(outputs + 1, inputs)
    for change, error in zip(changes, errors, strict=True):
        sums = sums.after(change, np.append(error, np.nan), 1.0, 1.0)
    found = sums.slopes(np.full((outputs + 1, inputs), 1e3))
    expected = np.linalg.lstsq(np.column_stack([changes, np.ones(200)]), errors, rcond=None)[0][:-1].T
    np.testing.assert_allclose(found[:-1], expected, atol=1e-4)
    assert not found[-1].any()


@given(seed=st.integers(0, 10**6), noise=st.floats(0.1, 10.0))
def test_noise_alone_makes_no_slope_that_was_not_expected(seed: int, noise: float) -> None:
    """Ten pairs without any slope: what is found stays within what was expected beforehand."""
    generator = np.random.default_rng(seed)
    sums = SlopeSums.none(1, 1)
    for _ in range(10):
        sums = sums.after(generator.normal(0, 0.05, 1), generator.normal(0, noise, 1), 0.05, 0.99)
    assert abs(sums.slopes(np.full((1, 1), 0.5))[0, 0]) < 0.5


def test_what_is_forgotten_is_expected_no_more() -> None:
    """A slope that was seen long ago fades to the prior, which is zero."""
    sums = SlopeSums.none(1, 1).after(np.array([1.0]), np.array([0.3]), 1.0, 1.0)
    for _ in range(50):
        sums = sums.after(np.zeros(1), np.zeros(1), 1.0, 0.5)
    assert abs(sums.slopes(np.full((1, 1), 0.5))[0, 0]) < 1e-6


def test_a_plan_is_taken_over_with_what_was_answered(model: Model) -> None:
    """States are added behind those of the smaller model; inputs and what was answered stay where they are."""
    problem = OptimalControlProblem(model, Prices(), LIMITS, HORIZON, MOVE_S, answer_s=100.0)
    layout, nx = problem.layout, len(model.states)
    plan = cold(problem, model)
    same = with_further_states(plan, layout, layout, plan[:nx] * layout.x_scale)
    np.testing.assert_array_equal(same, plan)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"settling_s": -1.0}, "settling_s = -1"),
        ({"settling_s": 10.0}, "at least move_s"),
        ({"memory_s": 0.0}, "memory_s = 0"),
        ({"prior": 0.0}, "prior = 0"),
        ({"outputs": ["levle"]}, "'levle' is no output of the model; did you mean 'level'"),
        ({"outputs": "level"}, "outputs = 'level'; give a list of names"),
        ({"memory_s": "long"}, "memory_s = 'long'; give a positive number"),
        ({"memory": 3.0}, "'memory' is no option; did you mean 'memory_s'"),
        ("yes", "modifiers = 'yes'; give true, false or options"),
    ],
)
def test_an_option_outside_its_range_is_told(asked: Any, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        mpc(modifiers=asked)


def test_another_model_learns_its_slopes_anew() -> None:
    """Slopes are errors of one model. The next one keeps the bias, and begins its runs and slopes anew."""
    controller, tanks = mpc(modifiers=True), plant(0.055)[0]
    learner = controller.modifiers
    assert learner is not None
    x, believed = (steady_state(m, np.array([START])).state for m in (tanks, make_model()))
    estimator = Fixed(Setup(make_model(), DT, ("upper_outflow",), ("level",)))
    belief = estimator.init(Prior(0.0, believed, np.array([0.05]), np.eye(1), np.array([0.05])))
    state, estimates = learner.init(0.0), list[Estimate]()
    for k in range(300):
        u = np.array([START + 0.5 * (k > 100)])
        x, y, _ = Stepper(tanks, DT).call(x, DT * k, u, tanks.parameter_values)
        sample = Sample(DT * (k + 1), u, y)
        belief, estimate = estimator.update(belief, sample)
        estimates.append(estimate)
        state = learner.heard(state, sample, estimate)
    assert state.starts and learner.slopes(state)[0, 0] < -0.1
    after = learner.taken_over(state, estimates[-50:], estimates[-50:])
    assert not after.starts and not learner.slopes(after).any()
    np.testing.assert_array_equal(after.biases, state.biases)
