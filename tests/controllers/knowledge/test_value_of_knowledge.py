"""Detours are made where what they teach is worth more than they cost; else every bit is the plain controller's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from adaptive_flot.contracts import Estimate, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import FloatArray, Stepper, steady_state
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.testing import ControllerCase, controller_case, flotation_process
from adaptive_flot.testing.processes import ROWS
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.probing.knowledge import Knowledge

NOISE = {"concentrate_grade": 1e-3}
LEVEL, FEED = 0.33, 1.67e-4
PRICES = Prices(treatment=0.25)
"""With these the best air flow lies inside its range and off the grade limit."""
BEST_AIR = 1.255e-3
NAMES = ("floatability.chalcopyrite", "coalescence_rate")


def case(**probing: Any) -> ControllerCase:
    """At the best steady state, with parameters that the grade at rest does not tell apart."""
    process = flotation_process()
    assert process.limits is not None
    inputs = np.tile([BEST_AIR, FEED, LEVEL], (ROWS, 1))
    limits = replace(process.limits, outputs={"concentrate_grade": (0.15, np.inf)})
    process = replace(process, inputs=inputs, parameters=NAMES, economics=PRICES, limits=limits, drifting=NAMES[0])
    options = {"by": "value", "noise_std": NOISE} | probing if probing else None
    return controller_case(EconomicMpc, process=process, horizon=10, solver="fatrop", probing=options)


@cache
def knowing() -> ControllerCase:
    return case(lasts_s=1800.0)


def knowledge_of(made: ControllerCase) -> tuple[EconomicMpc, Knowledge]:
    assert isinstance(made.controller, EconomicMpc) and isinstance(made.controller.probing, Knowledge)
    return made.controller, made.controller.probing


def uncertain(estimate: Estimate, share: float, correlation: float = -0.9) -> Estimate:
    std = np.diag(share * estimate.parameters)
    return replace(estimate, covariance=std @ np.array([[1.0, correlation], [correlation, 1.0]]) @ std)


def first_decision(made: ControllerCase, share: float) -> tuple[FloatArray, Status, str]:
    state, _ = made.controller.decide(made.controller.init(0.0), None, None)
    state, decision = made.controller.decide(state, made.samples[0], uncertain(made.estimates[0], share))
    return decision.inputs, decision.status, decision.decided_by


def value(air: float, p: FloatArray) -> float:
    model, u = flotation_process().model, np.array([air, FEED, LEVEL])
    x = steady_state(model, u, p).state
    y = np.array(model.ode(0.0, x, u, p)[1]).ravel()
    grade, recovery = (y[model.index("outputs", name)] for name in ("concentrate_grade", "recovery"))
    metal = recovery * p[model.index("parameters", "feed_concentration.chalcopyrite")] * FEED
    return float(PRICES.metal * metal - PRICES.treatment * metal / grade - PRICES.air * air)


def best_air(p: FloatArray) -> float:
    found = minimize_scalar(
        lambda a: -1e6 * value(a, p), bounds=(1e-3, 2e-3), method="bounded", options={"xatol": 1e-8}
    )
    return float(found.x)


def resting(made: ControllerCase) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Variables of a plan at rest, inputs, state and parameters."""
    controller, _ = knowledge_of(made)
    model, u = made.setup.model, made.setup.schedule[0]
    x, p = steady_state(model, u).state, model.parameter_values
    z = np.array(model.ode(0.0, x, u, p)[3]).ravel()
    return controller.layout.start(x, u[controller.layout.moved], z), u, x, p


def test_with_no_weight_or_nothing_uncertain_it_is_the_plain_controller_to_the_bit() -> None:
    plain, certain = first_decision(case(), 0.3), first_decision(knowing(), 0.0)
    np.testing.assert_array_equal(certain[0], plain[0])
    np.testing.assert_array_equal(first_decision(case(weight=0.0), 0.3)[0], plain[0])
    assert plain[1:] == certain[1:] == (Status.OK, "economic_mpc")


def test_a_detour_is_made_where_much_is_unknown_and_not_where_little_is() -> None:
    """Within the largest move, by a valid plan, and told as probing."""
    plain, probed = first_decision(case(), 0.3)[0], first_decision(knowing(), 0.3)
    air = knowing().setup.model.index("inputs", "air_flow")
    assert probed[1:] == (Status.OK, "probing")
    assert 1e-4 < abs(probed[0][air] - BEST_AIR) <= 2e-4 and abs(plain[air] - BEST_AIR) < 5e-5
    assert first_decision(knowing(), 1e-3)[2] == "economic_mpc"


@pytest.mark.parametrize("off", [(0.1, 0.0), (0.0, 0.1), (-0.1, 0.04)])
def test_the_loss_is_the_one_of_a_controller_that_believes_other_parameters(off: tuple[float, float]) -> None:
    """Known answer: the best air flow by a search over steady states, its value with the true parameters."""
    made = knowing()
    _, knowledge = knowledge_of(made)
    plan, u, _, p = resting(made)
    hessian = knowledge.stakes(plan, np.full((10, 1), 0.3), np.array([0.15]), u, p)
    adapted = made.setup.model.indices("parameters", NAMES)
    change = np.array(off) * p[adapted]
    believed = p.copy()
    believed[adapted] += change
    lost = value(best_air(p), p) - value(best_air(believed), p)
    assert change @ hessian @ change / 2 == pytest.approx(lost, rel=0.15)


def test_nothing_is_lost_where_limits_alone_say_where_to_go() -> None:
    """The level at an end of its range and the grade at its limit: feedback finds both."""
    made = knowing()
    _, knowledge = knowledge_of(made)
    plan, u, _, p = resting(made)
    assert not knowledge.stakes(plan, np.full((10, 1), 0.15), np.array([0.15]), u, p).any()


def test_a_plan_at_rest_teaches_one_combination_and_a_move_the_other_one_too() -> None:
    """Of two parameters and one measured output; the covariance never grows without a walk."""
    made = knowing()
    _, knowledge = knowledge_of(made)
    plan, u, x, p = resting(made)
    theta = p[made.setup.model.indices("parameters", NAMES)]
    wide = np.diag((0.2 * theta) ** 2)

    def relative(variables: FloatArray, measured: Any = knowledge) -> FloatArray:
        found = measured.information(variables, u, p, theta, wide, (0.0, x))
        return np.linalg.eigvalsh(found / np.outer(theta, theta))[:, ::-1]

    rest = relative(plan)
    assert rest[1, 1] < 1e-3 * rest[0, 1] and rest[-1, 0] > 0.99 * rest[1, 0]
    moved = plan.copy()
    layout = knowledge.layout
    air = u.copy()
    air[0] += 2e-4
    run = Stepper(made.setup.model, 1.0).simulate(x, np.tile(air, (300, 1)))
    layout.stages(moved)[:, layout.chosen.start] = air[0] / layout.u_scale[0]
    for k in range(layout.horizon):
        for j, row in enumerate((30 * k + 9, 30 * k + 29)):
            at = slice(layout.point(j), layout.point(j) + len(x))
            layout.stages(moved)[k, at] = run.states[row] / layout.x_scale
    assert relative(moved)[-1, 0] < 0.2 * rest[-1, 0]
    assert (np.diff(relative(moved).sum(axis=1)) <= 1e-12).all()
    walking = knowledge_of(case(walk=0.5))[1]
    assert relative(plan, walking)[-1, 0] > rest[-1, 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"by": "luck"}, "by = 'luck'"),
        ({"noise_std": None}, "needs noise_std; give the standard deviation"),
        ({"noise_std": {}}, "noise_std > 0 of each measured output"),
        ({"walk": -1.0}, "walk >= 0"),
        ({"lasts_s": -1.0}, "at least 0"),
        ({"lengths": [11]}, "1 to 10, the horizon"),
        ({"inputs": ["feed_flow"]}, "no input that the controller moves"),
    ],
)
def test_an_option_out_of_range_is_one_clear_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        case(**options)
