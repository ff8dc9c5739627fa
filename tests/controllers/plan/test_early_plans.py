"""A plan before its time: made where an output leaves its plan beyond a limit, and within the largest moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Decision
from adaptive_flot.greybox import FloatArray
from adaptive_flot.testing import ControllerCase, controller_case
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.early import Early, counted, narrowed
from controllers.economic_mpc.scenarios import Misfit
from controllers.economic_mpc.state import MpcState

LOW = -0.02
"""Of the grade: what an unknown disturbance takes."""
MOVES = np.array([2e-4, 0.01])


def first_plan(case: ControllerCase, bias: float = 0.0) -> tuple[EconomicMpc, MpcState]:
    controller = case.controller
    assert isinstance(controller, EconomicMpc)
    silent = replace(case.estimates[0], innovation=np.full_like(case.estimates[0].innovation, np.nan))
    state, _ = controller.decide(replace(controller.init(0.0), bias=(bias,)), case.samples[0], silent)
    return controller, state


def later(case: ControllerCase, state: MpcState, seconds: float, bias: float) -> tuple[MpcState, Decision]:
    """The decision some seconds later, with a bias of the grade."""
    time = case.samples[0].time + seconds
    silent = replace(case.estimates[0], time=time, innovation=np.full_like(case.estimates[0].innovation, np.nan))
    return case.controller.decide(replace(state, bias=(bias,)), replace(case.samples[0], time=time), silent)


@pytest.fixture(scope="module")
def case() -> ControllerCase:
    return controller_case(EconomicMpc, horizon=6, solver="fatrop", early_plans=True)


def test_a_grade_below_limit_and_plan_is_answered_at_once(case: ControllerCase) -> None:
    """Air lowers the grade: less of it. Without the option the inputs stay until the move is over."""
    controller, state = first_plan(case)
    assert state.inputs is not None
    air = case.setup.model.index("inputs", "air_flow")
    after, decision = later(case, state, 5.0, LOW)
    assert decision.plan is not None and decision.inputs[air] < state.inputs[air] - 1e-5
    assert after.due == pytest.approx(case.samples[0].time + 5.0 + controller.layout.move_s)
    plain = controller_case(EconomicMpc, horizon=6, solver="fatrop")
    held, decision = later(plain, first_plan(plain)[1], 5.0, LOW)
    assert decision.plan is None
    np.testing.assert_array_equal(decision.inputs, held.inputs)


def test_two_plans_in_a_row_are_not_early(case: ControllerCase) -> None:
    _, state = first_plan(case)
    state, decision = later(case, state, 5.0, LOW)
    assert decision.plan is not None
    _, decision = later(case, state, 10.0, 3 * LOW)
    assert decision.plan is None


def test_both_moves_together_are_no_larger_than_one_may_be(case: ControllerCase) -> None:
    controller, state = first_plan(case)
    moved = controller.layout.moved
    before = case.samples[0].inputs[moved]
    _, decision = later(case, state, 5.0, 5 * LOW)
    assert decision.plan is not None
    assert (np.abs(decision.inputs[moved] - before) <= MOVES * (1 + 1e-3)).all()


def test_on_the_way_back_to_a_limit_no_plan_is_early(case: ControllerCase) -> None:
    """The plan was made below the limit: that the grade is still there before the move is over tells nothing new."""
    _, state = first_plan(case, 3 * LOW)
    _, decision = later(case, state, 5.0, 5 * LOW)
    assert decision.plan is None


@pytest.mark.parametrize("made", [[2e-4, 0.01], [-2e-4, 0.0], [1e-4, -0.004], [0.0, 0.0]])
def test_bounds_of_an_early_move(case: ControllerCase, made: list[float]) -> None:
    """What is left of the largest move in the direction of the one before; to the other side, all of one move."""
    controller, _ = first_plan(case)
    layout, plain = controller.layout, controller.planner.bounds
    found = narrowed(plain, layout, np.array([1.5e-3, 0.38]) + made, np.array([1.5e-3, 0.38]))
    row = layout.rows["moves"][0]
    low, high = (found[key][row] * layout.u_scale for key in ("lbg", "ubg"))
    np.testing.assert_allclose(low, np.maximum(-MOVES, -MOVES - made), atol=1e-12)
    np.testing.assert_allclose(high, np.minimum(MOVES, MOVES - made), atol=1e-12)
    others = np.setdiff1d(np.arange(len(plain["lbg"])), row)
    np.testing.assert_array_equal(found["lbg"][others], plain["lbg"][others])


@pytest.mark.parametrize(
    ("planned", "came", "due"),
    [
        (0.203, 0.199, True),
        (0.199, 0.199, False),  # below the limit, as planned: nothing new
        (0.210, 0.205, False),  # off the plan, but inside the limit
        (0.203, float("nan"), False),
    ],
)
def test_what_makes_a_plan_due(case: ControllerCase, planned: float, came: float, due: bool) -> None:
    controller, state = first_plan(case)
    early = Early(controller.layout, controller.planner.limits)
    state = replace(state, misfit=replace(state.misfit, expected=(30.0, (planned,))))
    assert early.is_due(state, np.array([came])) is due
    assert not early.is_due(replace(state, moved_from=None), np.array([came]))


def test_the_error_of_a_plan_that_is_given_up_counts() -> None:
    planned = replace(Misfit.none(1), expected=(30.0, (0.2,)))
    came: FloatArray = np.array([0.19])
    assert counted(planned, 8.0, came).variance[0] == pytest.approx(1e-4)
