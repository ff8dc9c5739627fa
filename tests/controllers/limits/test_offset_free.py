"""No offset at steady state though the model is wrong: what is planned for the limited output is what comes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import ControllerSetup, Prior, Sample, Setup
from adaptive_flot.greybox import Stepper, steady_state
from adaptive_flot.testing import flotation_process
from controllers.economic_mpc.controller import EconomicMpc
from estimators.adaptive_imm import AdaptiveImm
from estimators.fixed import Fixed

NAMES = ("growth_exponent", "coalescence_rate")
WRONG = {"floatability.chalcopyrite": 0.9, "floatability.quartz": 1.1, "burst_b": 0.98}
"""Factors of constants of the plant that no controller is told."""
ROWS = 2400


@pytest.mark.parametrize("estimator", [Fixed, AdaptiveImm])
@pytest.mark.parametrize("options", [{}, {"scenarios": 3}], ids=["nominal", "tree"])
def test_the_planned_grade_is_the_one_that_comes(estimator: Any, options: dict[str, Any]) -> None:
    """Forty minutes without noise; the last plans' grade for the end of their first move, against the plant's.

    `fixed` leaves all of the error to the controller's bias. `adaptive_imm` takes it up in parameters and a discrepancy
    of its own: none of it may be counted twice, and none be lost.
    """
    process = flotation_process()
    model = process.model
    p = model.parameter_values
    for name, factor in WRONG.items():
        p[model.index("parameters", name)] *= factor
    inputs = process.inputs[0]
    theta = model.parameter_values[model.indices("parameters", NAMES)]
    own = estimator(Setup(model, 1.0, NAMES, ("concentrate_grade",)))
    belief = own.init(
        Prior(0.0, steady_state(model, inputs).state, theta, np.diag((0.05 * theta) ** 2), np.array([1e-3]))
    )
    setup = ControllerSetup(model, 1.0, process.inputs, NAMES, process.limits, process.economics)
    controller = EconomicMpc(setup, horizon=10, solver="fatrop", **options)
    step, x = Stepper(model, 1.0), steady_state(model, inputs, p).state
    grade = model.index("outputs", "concentrate_grade")
    state, decision = controller.decide(controller.init(0.0), None, None)
    planned, came = {}, {}
    for k in range(ROWS):
        x, y, _ = step.call(x, float(k), decision.inputs, p)
        sample = Sample(float(k + 1), decision.inputs, y)
        belief, estimate = own.update(belief, sample)
        state, decision = controller.decide(state, sample, estimate)
        came[k + 1.0] = float(y[grade])
        if decision.plan is not None:
            planned[float(decision.plan.time[0])] = float(decision.plan.outputs["concentrate_grade"][0])
    errors = [planned[t] - came[t] for t in sorted(planned) if t in came][-5:]
    np.testing.assert_allclose(errors, 0.0, atol=2e-4)
    held = decision.inputs
    alone = model.ode(0.0, steady_state(model, held).state, held, model.parameter_values)[1][grade]
    assert abs(alone - came[float(ROWS)]) > 5e-3, "the plant is so near the model that nothing is tested"
