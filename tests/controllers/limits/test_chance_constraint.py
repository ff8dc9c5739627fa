"""Back-off from a covariance: nothing without one, the quantile of the output's own spread with one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import ControllerSetup
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.testing import controller_case
from controllers.economic_mpc.chance_constraint import ChanceConstraint
from controllers.economic_mpc.controller import EconomicMpc

NAMES = ("growth_exponent", "coalescence_rate")


def test_zero_covariance_is_the_nominal_controller_to_the_bit() -> None:
    """Every decision of 35 samples, two optimisations among them."""
    decided = []
    choices: list[dict[str, Any]] = [{}, {"limit_probability": 0.99}]
    for options in choices:
        case = controller_case(EconomicMpc, horizon=6, solver="fatrop", **options)
        state = case.controller.init(0.0)
        state, _ = case.controller.decide(state, None, None)
        rows = []
        for sample, estimate in zip(case.samples[:35], case.estimates[:35], strict=True):
            known = replace(estimate, covariance=np.zeros_like(estimate.covariance))
            state, decision = case.controller.decide(state, sample, known)
            rows.append(decision.inputs)
        decided.append(np.array(rows))
    np.testing.assert_array_equal(decided[0], decided[1])


def test_an_uncertain_estimate_keeps_the_plan_off_the_limit() -> None:
    """The grade that is planned at the end is higher where n and C are known to 3 % than where they are known."""
    planned = []
    for std in (0.0, 0.03):
        case = controller_case(EconomicMpc, horizon=6, solver="fatrop", limit_probability=0.95)
        state = case.controller.init(0.0)
        state, _ = case.controller.decide(state, None, None)
        estimate = case.estimates[0]
        covariance = np.diag((std * estimate.parameters) ** 2)
        _, decision = case.controller.decide(state, case.samples[0], replace(estimate, covariance=covariance))
        assert decision.plan is not None
        planned.append(decision.plan.outputs["concentrate_grade"][-1])
    assert planned[1] > planned[0] + 1e-4


def test_the_back_off_is_the_quantile_of_the_steady_output() -> None:
    """Against the spread of steady grades, from differences of the steady state for n and for C."""
    case = controller_case(EconomicMpc, horizon=6, solver="fatrop")
    model, dt = case.setup.model, case.setup.dt
    inputs = case.setup.schedule[0]
    setup = ControllerSetup(model, dt, case.setup.schedule, NAMES)
    grade = model.index("outputs", "concentrate_grade")
    p = model.parameter_values
    columns = model.indices("parameters", NAMES)
    slopes = []
    for j in columns:
        ends = []
        for sign in (1, -1):
            moved = p.copy()
            moved[j] *= 1 + sign * 1e-4
            x = steady_state(model, inputs, moved).state
            ends.append(float(model.ode(0.0, x, inputs, moved)[1][grade]))
        slopes.append((ends[0] - ends[1]) / (2e-4 * p[j]))
    covariance = np.diag((0.02 * p[columns]) ** 2)
    covariance[0, 1] = covariance[1, 0] = -0.9 * np.sqrt(covariance[0, 0] * covariance[1, 1])
    kept = ChanceConstraint(setup, [grade], 0.95).backoff(
        0.0, steady_state(model, inputs, p).state, inputs, p, covariance
    )
    assert kept[0] == pytest.approx(1.6449 * np.sqrt(slopes @ covariance @ np.array(slopes)), rel=1e-3)


@pytest.mark.parametrize("probability", [0.4, 1.0, float("nan")])
def test_a_probability_out_of_range_is_a_named_error(probability: float) -> None:
    with pytest.raises(ModelError, match="limit_probability"):
        controller_case(EconomicMpc, horizon=6, limit_probability=probability)
