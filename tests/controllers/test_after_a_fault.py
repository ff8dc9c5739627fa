"""A step after a fault is that of a fresh controller: what failed leaves nothing behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Decision, Estimate, Sample, Status
from adaptive_flot.testing import ControllerCase, controller_case
from adaptive_flot.testing.comparing import same
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.state import MpcState

STEPS = 10
"""Moves that fail; longer than the horizon, so that the plan runs out too."""


def make(solver: str) -> ControllerCase:
    return controller_case(EconomicMpc, horizon=6, solver=solver)


@pytest.fixture(scope="module", params=["fatrop", "ipopt"])
def pair(request: pytest.FixtureRequest) -> tuple[ControllerCase, ControllerCase]:
    """One controller to go through the fault, and another, built apart, that never saw it."""
    return make(request.param), make(request.param)


def fresh_decision(case: ControllerCase, held: MpcState, sample: Sample, estimate: Estimate) -> Decision:
    """Of a controller that starts now, with the inputs that are held now."""
    assert held.inputs is not None
    state = replace(case.controller.init(sample.time), inputs=held.inputs.copy())
    return case.controller.decide(state, sample, estimate)[1]


@pytest.mark.parametrize("fault", ["solver_failure", "nan_state", "nan_parameters"])
def test_after_ten_failed_moves_it_decides_as_a_fresh_controller(
    pair: tuple[ControllerCase, ControllerCase], fault: str
) -> None:
    """The same state, estimate and held inputs give the same inputs and plan to the bit."""
    (case, other), solver = pair, None
    assert isinstance(case.controller, EconomicMpc)
    sample, estimate = case.samples[-1], case.estimates[-1]
    state, _ = case.controller.decide(case.controller.init(0.0), None, None)
    state, first = case.controller.decide(state, replace(sample, time=0.0), replace(estimate, time=0.0))
    assert first.status is Status.OK
    for k in range(1, STEPS + 1):
        now = 30.0 * k
        told = replace(estimate, time=now)
        solver = case.controller
        if fault == "solver_failure":
            solver = case.controller.with_failing_solver()
        elif fault == "nan_state":
            told = replace(told, state=np.full_like(told.state, np.nan))
        else:
            told = replace(told, parameters=np.full_like(told.parameters, np.nan))
        state, decision = solver.decide(state, replace(sample, time=now), told)
        assert decision.status in (Status.SHIFTED_PLAN, Status.HELD) and np.isfinite(decision.inputs).all()
        low, high = case.controller._bounds.inputs.T
        moved = decision.inputs[case.controller.layout.moved]
        assert (moved >= low).all() and (moved <= high).all()
    now = 30.0 * (STEPS + 1)
    sample, estimate = replace(sample, time=now), replace(estimate, time=now)
    expected = fresh_decision(other, state, sample, estimate)
    _, after = case.controller.decide(state, sample, estimate)
    assert after.status is Status.OK
    assert same(after.inputs, expected.inputs)
    assert after.plan is not None and expected.plan is not None
    assert same(after.plan.outputs["concentrate_grade"], expected.plan.outputs["concentrate_grade"])
    assert all(same(after.plan.inputs[name], expected.plan.inputs[name]) for name in expected.plan.inputs)
