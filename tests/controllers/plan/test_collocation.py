"""The optimal control problem predicts what the cell then does, and all solvers find the same plan."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts import Limits
from adaptive_flot.greybox import FloatArray, Model, Stepper, steady_state
from adaptive_flot.processes.flotation.economics import Prices, value_rates
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.layout import Bounds
from controllers.economic_mpc.problem.stage import Arguments
from controllers.economic_mpc.solvers.nlp_solvers import SOLVERS, make_solver
from controllers.economic_mpc.solvers.verification import Validity, Verifier

MOVE_S, HORIZON = 30.0, 8
PRICES = 1000 * np.array([*Prices().prices(), 1e-3, 1e-3, 1e-3])
BOUNDS = Bounds(np.array([[9.05e-4, 2.17e-3], [0.33, 0.42]]), np.array([2e-4, 0.01]), np.array([[0.33, 0.42]]))
LIMITS = Limits(
    outputs={"concentrate_grade": (0.20, np.inf)},
    inputs={"air_flow": (9.05e-4, 2.17e-3), "level_setpoint": (0.33, 0.42)},
    moves={"air_flow": 2e-4, "level_setpoint": 0.01},
    states={"level": (0.33, 0.42)},
)
HELD = np.array([1.5e-3, 1.67e-4, 0.38])


def cell_problem(model: Model, horizon: int = HORIZON) -> OptimalControlProblem:
    return OptimalControlProblem(model, Prices(), LIMITS, horizon, MOVE_S)


@pytest.fixture(scope="module")
def problem(model: Model) -> OptimalControlProblem:
    return cell_problem(model)


def arguments(model: Model, **changes: object) -> FloatArray:
    values: dict[str, object] = {
        "state": steady_state(model, HELD).state,
        "previous": HELD[[0, 2]],
        "parameters": model.parameter_values,
        "disturbances": HELD[[1]],
        "limits": np.array([0.2]),
        "biases": np.zeros(1),
        "prices": PRICES,
    }
    return Arguments(**{**values, **changes}).vector()  # type: ignore[arg-type]


def cold(problem: OptimalControlProblem, model: Model) -> FloatArray:
    x = steady_state(model, HELD).state
    gas = np.array([HELD[0] / model.parameter_values[model.index("parameters", "A")]])
    return problem.layout.start(x, HELD[[0, 2]], gas)


def test_the_plan_is_what_the_cell_does(problem: OptimalControlProblem, model: Model) -> None:
    """States of the plan against the fast step under the planned inputs: the collocation error of 30 s moves."""
    solution = make_solver(problem, "ipopt", 10.0)(
        arguments(model), problem.layout.bounds(BOUNDS), cold(problem, model)
    )
    assert solution.validity is Validity.VALID
    inputs = problem.layout.inputs_of(solution.variables)
    held = np.column_stack([inputs[:, 0], np.full(HORIZON, HELD[1]), inputs[:, 1]])
    run = Stepper(model, 1.0).simulate(steady_state(model, HELD).state, np.repeat(held, int(MOVE_S), axis=0))
    block = problem.layout.block
    planned = np.array(
        [solution.variables[k * block : k * block + 9] * problem.layout.x_scale for k in range(1, HORIZON)]
    )
    done = run.states[int(MOVE_S) - 1 :: int(MOVE_S)][: HORIZON - 1]
    np.testing.assert_allclose(planned / done, 1.0, atol=3e-3)


def test_all_solvers_find_the_same_plan(problem: OptimalControlProblem, model: Model) -> None:
    now, bounds, first = arguments(model), problem.layout.bounds(BOUNDS), cold(problem, model)
    plans = [
        problem.layout.inputs_of(make_solver(problem, name, 10.0)(now, bounds, first).variables) for name in SOLVERS
    ]
    for plan in plans[1:]:
        np.testing.assert_allclose(plan / plans[0], 1.0, atol=1e-3)


@pytest.mark.parametrize("solver", SOLVERS)
def test_nothing_is_rebuilt_when_an_argument_changes(problem: OptimalControlProblem, model: Model, solver: str) -> None:
    """Estimate, state, previous inputs, disturbance, limit, bias, prices and bounds are arguments of one function."""
    built = make_solver(problem, solver, 10.0)
    plain = built(arguments(model), problem.layout.bounds(BOUNDS), cold(problem, model))
    theta = model.parameter_values.copy()
    theta[model.index("parameters", "C")] *= 1.1
    for changes in (
        {"parameters": theta},
        {"limits": np.array([0.21])},
        {"biases": np.array([-0.01])},
        {"disturbances": np.array([1.8e-4])},
        {"prices": PRICES * np.array([1, 1, 3e4, 1, 1, 1, 1])},
        {"previous": np.array([1.2e-3, 0.38])},
    ):
        now = arguments(model, **changes)
        other = built(now, problem.layout.bounds(BOUNDS), plain.variables, plain.multipliers)
        assert other.validity is Validity.VALID
        assert not np.allclose(
            problem.layout.inputs_of(other.variables), problem.layout.inputs_of(plain.variables), rtol=1e-4
        )
    narrow = Bounds(np.array([[9.05e-4, 1.5e-3], [0.33, 0.42]]), BOUNDS.moves, BOUNDS.states)
    other = built(arguments(model), problem.layout.bounds(narrow), plain.variables, plain.multipliers)
    assert np.max(problem.layout.inputs_of(other.variables)[:, 0]) <= 1.5e-3 * (1 + 1e-4)


def test_plans_keep_bounds_and_moves(problem: OptimalControlProblem, model: Model) -> None:
    solution = make_solver(problem, "fatrop", 10.0)(
        arguments(model), problem.layout.bounds(BOUNDS), cold(problem, model)
    )
    inputs = np.vstack([HELD[[0, 2]], problem.layout.inputs_of(solution.variables)])
    assert np.all(np.abs(np.diff(inputs, axis=0)) <= BOUNDS.moves * (1 + 1e-3))
    assert np.all(inputs[1:] >= BOUNDS.inputs[:, 0] * (1 - 1e-4)) and np.all(inputs <= BOUNDS.inputs[:, 1] * (1 + 1e-4))


def test_verification_catches_what_a_solver_may_return(problem: OptimalControlProblem, model: Model) -> None:
    bounds, now, start = problem.layout.bounds(BOUNDS), arguments(model), cold(problem, model)
    good = make_solver(problem, "ipopt", 10.0)(now, bounds, start).variables
    verify = Verifier(problem)
    assert verify(good, now, bounds) == (Validity.VALID, "")
    assert verify(good * np.nan, now, bounds)[0] is Validity.NOT_FINITE
    outside = good.copy()
    outside[problem.layout.block + 9] += 5.0  # an input of the second stage, far beyond its bound and its moves
    validity, message = verify(outside, now, bounds)
    assert validity is Validity.VIOLATED
    assert "air_flow" in message and message.count(";") <= 5


def test_an_infeasible_problem_names_the_worst_constraints(problem: OptimalControlProblem, model: Model) -> None:
    """A range of the set-point that no allowed move reaches: it is not VALID, and the message says what breaks."""
    impossible = Bounds(np.array([BOUNDS.inputs[0], [0.40, 0.42]]), BOUNDS.moves, BOUNDS.states)
    solution = make_solver(problem, "ipopt", 5.0)(
        arguments(model), problem.layout.bounds(impossible), cold(problem, model)
    )
    assert solution.validity is Validity.VIOLATED
    assert "level_setpoint" in solution.message and " by " in solution.message


def test_terms_of_the_objective_add_up(problem: OptimalControlProblem, model: Model) -> None:
    now, x = arguments(model), cold(problem, model)
    terms = np.array(problem.terms(x, now)).ravel()
    y = Stepper(model, 1.0).outputs_at(steady_state(model, HELD).state, 0.0, HELD, model.parameter_values)
    rates = value_rates(y[0], y[1], HELD[0], HELD[1], 10.6, PRICES)
    expected = [HORIZON * MOVE_S * rates[name] for name in ("metal", "treatment", "air", "reagent")]
    np.testing.assert_allclose(terms[:4], expected, rtol=1e-6)
    assert terms[4:].tolist() == [0.0, 0.0, 0.0]
