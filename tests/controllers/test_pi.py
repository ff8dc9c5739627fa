"""The PI baseline holds the grade at its set-point, within the air limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Stepper, steady_state
from adaptive_flot.protocols import Sample, Status
from adaptive_flot.testing import controller_case
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
    with pytest.raises(ModelError, match="'air_flow'; give its range"):
        Pi(replace(setup, limits=replace(setup.limits, inputs={})))


def test_hold_holds() -> None:
    case = controller_case(Hold)
    state = case.controller.init(0.0)
    for sample in (None, *case.samples[:3]):
        state, decision = case.controller.decide(state, sample, None)
        np.testing.assert_array_equal(decision.inputs, case.setup.schedule[0])
