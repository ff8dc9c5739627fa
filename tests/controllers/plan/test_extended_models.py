"""The optimal control problem of an extended model: states of effects, effects in time, effects on instruments."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.greybox import FloatArray, Model, Stepper, steady_state
from adaptive_flot.greybox.effects import Effect
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.stage import Arguments
from controllers.economic_mpc.solvers.nlp_solvers import SOLVERS, make_solver
from controllers.economic_mpc.solvers.verification import Validity
from tests.controllers.plan.test_collocation import BOUNDS, HELD, HORIZON, MOVE_S, PRICES, cell_problem

NOW = 360.0
GROWTH = Effect("bubble_size", "air_flow", "power", {"exponent": 0.3}, {"reference": 1.5e-3})
LATE_FEED = Effect(
    "feed_flow", "delay", "delay", {"amplitude": 1.0, "dead_time": 60.0}, {"scale": 1.67e-4, "stages": 3}
)
RAMP = Effect("coalescence", "time", "ramp", {"amplitude": 0.3, "onset": 400.0, "duration": 60.0})
VALVE = Effect("air_flow", "lag", "stiction", {"amplitude": 1.0, "band": 2e-5}, {"scale": 1.5e-3})
OFFSET = Effect("grade_sensor", "constant", "shift", {"amplitude": 0.02})


def plan(
    problem: OptimalControlProblem, solver: str, time: float = NOW, bias: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Moved inputs (H, 2) and grades (H,) of a valid plan from the steady state."""
    model = problem.model
    x0 = steady_state(model, HELD, time=time).state
    now = Arguments(
        x0, HELD[[0, 2]], model.parameter_values, HELD[[1]], np.array([0.2]), np.array([bias]), PRICES, time
    ).vector()
    gas = np.array([HELD[0] / model.parameter_values[model.index("parameters", "A")]])
    solution = make_solver(problem, solver, 10.0)(
        now, problem.layout.bounds(BOUNDS), problem.layout.start(x0, HELD[[0, 2]], gas)
    )
    assert solution.validity is Validity.VALID, solution.message
    return problem.layout.inputs_of(solution.variables), np.array(problem.outputs(solution.variables, now)).ravel()


def simulated(model: Model, inputs: FloatArray) -> FloatArray:
    """Grade (H,) of the cell under planned moves, from the steady state."""
    held = np.column_stack([inputs[:, 0], np.full(HORIZON, HELD[1]), inputs[:, 1]])
    x0, p = steady_state(model, HELD, time=NOW).state, model.parameter_values
    run = Stepper(model, 1.0).simulate(x0, np.repeat(held, int(MOVE_S), axis=0), p, NOW)
    return run.outputs[int(MOVE_S) - 1 :: int(MOVE_S), model.index("outputs", "concentrate_grade")]


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_plan_is_what_the_extended_cell_does(model: Model, solver: str) -> None:
    """Against the fast step; the froth changes within the horizon, so a plan that takes another time is wrong."""
    extended = model.with_effects([GROWTH, LATE_FEED, RAMP])
    problem = cell_problem(extended)
    inputs, grades = plan(problem, solver)
    np.testing.assert_allclose(grades, simulated(extended, inputs), rtol=2e-3)
    inputs, grades = plan(problem, solver, time=0.0)
    assert np.abs(grades / simulated(extended, inputs) - 1).max() > 1e-2


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_valve_that_sticks_has_a_plan(model: Model, solver: str) -> None:
    """The dead band of the air valve is round enough for a solver, and the plan still that of the valve."""
    extended = model.with_effects([VALVE])
    inputs, grades = plan(cell_problem(extended), solver)
    np.testing.assert_allclose(grades, simulated(extended, inputs), rtol=1e-2)


def test_a_known_offset_of_the_analyser_changes_no_plan(model: Model) -> None:
    """Limit and prices hold for the concentrate: an analyser that is known to show too much moves nothing."""
    plain = plan(cell_problem(model), "ipopt")
    known = plan(cell_problem(model.with_effects([OFFSET])), "ipopt")
    for a, b in zip(plain, known, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)
