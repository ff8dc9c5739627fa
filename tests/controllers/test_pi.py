"""The PI baseline holds the grade at its set-point, within the air limits."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from adaptive_flot.contracts import Sample, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Stepper, steady_state
from adaptive_flot.testing import controller_case
from controllers.feed_forward import FeedForward, inverse
from controllers.hold import Hold
from controllers.pi import Pi


@pytest.mark.parametrize("limit_offset", [0.0, 0.03])
def test_it_brings_the_grade_to_the_set_point(limit_offset: float) -> None:
    case = controller_case(Pi, margin=0.004 + limit_offset)
    controller, model = case.controller, case.setup.model
    assert isinstance(controller, Pi)
    x = steady_state(model, case.setup.schedule[0]).state
    step, p = Stepper(model, 1.0).call, model.parameter_values
    state, decision = controller.decide(controller.init(0.0), None, None)
    for k in range(2500):
        x, y, _ = step(x, float(k), decision.inputs, p)
        state, decision = controller.decide(state, Sample(k + 1.0, decision.inputs, y), case.estimates[0])
        assert 9.05e-4 <= decision.inputs[0] <= 2.17e-3
    assert y[0] == pytest.approx(controller.setpoint, abs=5e-4)


def test_a_missing_grade_holds_the_air() -> None:
    case = controller_case(Pi)
    state, _ = case.controller.decide(case.controller.init(0.0), None, None)
    state, before = case.controller.decide(state, case.samples[0], case.estimates[0])
    blind = Sample(2.0, before.inputs, np.full_like(case.samples[0].outputs, np.nan))
    _, decision = case.controller.decide(state, blind, case.estimates[0])
    assert decision.status is Status.MISSING
    np.testing.assert_array_equal(decision.inputs, before.inputs)


def test_it_wants_the_range_of_the_air() -> None:
    setup = controller_case(Hold).setup
    assert setup.limits is not None
    with pytest.raises(ModelError, match="needs limits"):
        Pi(replace(setup, limits=None))
    with pytest.raises(ModelError, match="a range of one output and of one input"):
        Pi(replace(setup, limits=replace(setup.limits, inputs={})))


def test_hold_holds() -> None:
    case = controller_case(Hold)
    state = case.controller.init(0.0)
    for sample in (None, *case.samples[:3]):
        state, decision = case.controller.decide(state, sample, None)
        np.testing.assert_array_equal(decision.inputs, case.setup.schedule[0])


@pytest.mark.parametrize(("column", "factor"), [("feed_flow", 0.8), ("feed_grade", 0.8), ("feed_grade", 1.2)])
def test_a_measured_change_of_the_feed_hardly_moves_the_grade(column: str, factor: float) -> None:
    """The air of the linear inverse alone, on the nonlinear cell: a ninth of what the grade does without it."""
    setup = controller_case(Hold).setup
    model = setup.model
    inputs, p = np.array([1.5e-3, 1.67e-4, 0.39]), model.parameter_values
    ahead = FeedForward(replace(setup, schedule=inputs[None].copy()), ("air_flow", "concentrate_grade"))
    x = steady_state(model, inputs).state
    grade, air = model.index("outputs", "concentrate_grade"), model.index("inputs", "air_flow")
    before = Stepper(model, 1.0).simulate(x, inputs[None], p).outputs[0, grade]
    if column == "feed_flow":
        inputs[model.index("inputs", "feed_flow")] *= factor
    else:
        p[model.index("parameters", "feed_concentration.chalcopyrite")] *= factor
    alone, feed, helped = x, ahead.start(), x
    call, worst = Stepper(model, 1.0).call, np.zeros(2)
    for k in range(600):
        feed, change = ahead.step(feed, Sample(float(k), inputs, np.full(len(model.outputs), np.nan), parameters=p))
        moved = inputs.copy()
        moved[air] += change
        alone, y, _ = call(alone, float(k), inputs, p)
        helped, z, _ = call(helped, float(k), moved, p)
        worst = np.maximum(worst, np.abs([y[grade] - before, z[grade] - before]))
    assert worst[0] > 0.02 and worst[1] < worst[0] / 9


def test_feed_forward_without_a_stable_inverse_is_static() -> None:
    """A cell whose grade first goes the wrong way, or that does not act at once: the steady-state gain."""
    wrong_way = control.ss([[-1.0]], [[1.0]], [[2.0]], [[-1.0]])  # (1 - s) / (1 + s)
    later = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    feed = control.ss([[-1.0]], [[3.0]], [[1.0]], [[0.0]])
    for air in (wrong_way, later):
        static = control.sample_system(inverse(air, feed), 1.0)
        assert static.nstates == 0 and static.D.item() == pytest.approx(-3.0)


def test_the_first_decision_does_not_jump_with_the_feed_as_it_is() -> None:
    """What the feed-forward asks for at the hand-over is no change; later only changes of the feed count."""
    with_it, without = (controller_case(Pi, feed_forward=on) for on in (True, False))
    richer = with_it.setup.model.parameter_values * 1.1
    decided = []
    for case in (with_it, without):
        state, _ = case.controller.decide(case.controller.init(0.0), None, None)
        _, decision = case.controller.decide(state, replace(case.samples[0], parameters=richer), case.estimates[0])
        decided.append(decision.inputs)
    np.testing.assert_array_equal(decided[0], decided[1])
