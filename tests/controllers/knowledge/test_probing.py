"""Probing keeps its price, its limits and, switched off or not needed, every bit of what the MPC does without it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.contracts import Decision, Limits, Sample, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Stepper, steady_state
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.processes import flotation
from adaptive_flot.processes.flotation.economics import value_rates
from adaptive_flot.testing import ControllerCase, controller_case
from adaptive_flot.testing.comparing import same
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.probing.budget import Probing
from controllers.economic_mpc.problem.layout import StageLayout
from controllers.economic_mpc.solvers.verification import NlpSolution, Validity
from controllers.economic_mpc.state import MpcState, ProbeState

START = np.array([1.77e-3, 1.67e-4, 0.33])
"""Close to where the MPC ends up with nominal parameters: at the lowest level and the grade limit."""
LENGTH = 1500
WAGE = 0.02
"""cu/h; about two thirds of what a dip in every other move would cost."""


def make(**probing: float) -> ControllerCase:
    return controller_case(EconomicMpc, horizon=10, solver="fatrop", probing=probing or None)


@dataclass
class Loop:
    """A closed loop with the true state and parameters, whose estimator claims to be uncertain."""

    decisions: list[Decision]
    states: list[MpcState]
    grade: FloatArray
    value: FloatArray
    information: FloatArray


@pytest.fixture(scope="module")
def plain() -> Loop:
    return loop(make())


@pytest.fixture(scope="module")
def probed() -> Loop:
    return loop(make(most_cu_h=WAGE, needed_std=0.01))


def loop(case: ControllerCase) -> Loop:
    controller, model, prices = case.controller, case.setup.model, case.setup.economics
    assert isinstance(controller, EconomicMpc) and prices is not None
    gradient = Stepper(model, 1.0).one_step_gradient(case.setup.parameters)
    x, p = steady_state(model, START).state, model.parameter_values
    grade, recovery = (model.index("outputs", n) for n in ("concentrate_grade", "recovery"))
    feed = p[model.index("parameters", "feed_concentration.chalcopyrite")]
    recorded = Loop([], [], np.empty(LENGTH), np.empty(LENGTH), np.zeros((2, 2)))
    state = replace(controller.init(0.0), inputs=START.copy())
    u = START
    for k in range(LENGTH):
        x, y, psi = (np.asarray(v) for v in gradient(x, float(k), u, p))
        x, y, slope = x.ravel(), y.ravel(), psi[grade] * p[model.indices("parameters", case.setup.parameters)] / 1e-3
        sample = Sample(k + 1.0, u, y)
        estimate = replace(case.estimates[0], time=k + 1.0, state=x, innovation=np.zeros_like(y))
        rates = value_rates(y[grade], y[recovery], u[0], u[1], feed, prices.prices())
        recorded.grade[k], recorded.value[k] = y[grade], 3600 * sum(rates.values())
        recorded.information += np.outer(slope, slope)
        state, decision = controller.decide(state, sample, estimate)
        u = decision.inputs
        recorded.states.append(state)
        recorded.decisions.append(decision)
    return recorded


def test_not_needed_it_is_as_switched_off_to_the_bit() -> None:
    """An estimate certain enough is not probed: inputs, plans and multipliers are those of an MPC without probing."""
    off, idle = make(), make(needed_std=1e3)
    states = [c.controller.decide(c.controller.init(0.0), None, None)[0] for c in (off, idle)]
    for sample, estimate in zip(off.samples[:32], off.estimates[:32], strict=True):
        decided = [c.controller.decide(s, sample, estimate) for c, s in zip((off, idle), states, strict=True)]
        states = [state for state, _ in decided]
        (_, plain), (_, other) = decided
        assert same(plain.inputs, other.inputs) and plain.decided_by == other.decided_by == "economic_mpc"
        assert (plain.plan is None) == (other.plan is None)
        if plain.plan is not None and other.plan is not None:
            assert same(plain.plan.outputs["concentrate_grade"], other.plan.outputs["concentrate_grade"])
    assert same(states[0].plan, states[1].plan) and same(states[0].multipliers, states[1].multipliers)


def test_the_price_is_never_more_than_was_earned(probed: Loop) -> None:
    """At every moment; and the wage is used too."""
    spent = [s.probe.spent for s in probed.states if s.probe is not None]
    assert len(spent) == LENGTH and all(s <= WAGE * (k + 1) / 3600 + 1e-12 for k, s in enumerate(spent))
    assert spent[-1] > 0.7 * WAGE * LENGTH / 3600


def test_the_predicted_price_is_what_is_really_lost(plain: Loop, probed: Loop) -> None:
    """Once the cell holds the mineral that it did not give while the air dipped (some minutes; it is not lost)."""
    settled = 900  # a multiple of two moves: a dip and the move after it
    paid = [s.probe.spent for s in probed.states if s.probe is not None]
    lost = float(np.sum(plain.value[settled:] - probed.value[settled:])) / 3600
    assert lost == pytest.approx(paid[-1] - paid[settled], rel=0.3)


def test_it_tells_the_parameters_apart(plain: Loop, probed: Loop) -> None:
    """The information on what the grade hardly shows, the ridge of n and C: its smallest eigenvalue."""
    without, with_it = (np.linalg.eigvalsh(run.information)[0] for run in (plain, probed))
    assert with_it > 100 * without


def test_a_dip_is_one_move_within_the_limits_and_never_towards_the_grade_limit(plain: Loop, probed: Loop) -> None:
    air = np.array([d.inputs[0] for d in probed.decisions])
    by = [d.decided_by == "probing" for d in probed.decisions]
    lengths = np.diff(np.flatnonzero(np.diff([False, *by, False])))[::2]
    assert len(lengths) > 2 and set(lengths) <= {30}
    assert np.abs(np.diff(air)).max() <= 2e-4 * (1 + 1e-4) and (air >= 9.05e-4).all()
    assert probed.grade.min() > plain.grade.min() - 5e-4
    assert all(d.status is Status.OK for d in probed.decisions)


@settings(max_examples=50, deadline=None)
@given(prices=st.lists(st.floats(-0.01, 0.1), min_size=1, max_size=40), wage=st.floats(0.001, 1.0))
def test_no_sequence_of_prices_spends_more_than_the_wage(prices: list[float], wage: float) -> None:
    """Also when a price is predicted to be negative: that is no income."""
    layout, limits = make_layout()
    probing, state, before = Probing(layout, limits, most_cu_h=wage), ProbeState(0.0), 0.0
    for k, price in enumerate(prices):
        state, _ = probing.pay(state, price, 30.0 * (k + 1))
        assert before <= state.spent <= wage * 30.0 * (k + 1) / 3600 + 1e-12
        before = state.spent


@cache
def make_layout() -> tuple[StageLayout, Limits]:
    """Made once: neither depends on what is paid."""
    limits = make_limits()
    return StageLayout(flotation.make_model(), limits, 2, 30.0), limits


def make_limits() -> Limits:
    limits = make().setup.limits
    assert limits is not None
    return limits


def test_without_room_or_without_a_valid_plan_there_is_no_dip(monkeypatch: pytest.MonkeyPatch) -> None:
    """The lowest air flow is kept, and a dip that the solver can not plan is left: the free plan is applied."""
    case = make(most_cu_h=100.0, needed_std=0.0)
    controller = case.controller
    assert isinstance(controller, EconomicMpc) and isinstance(controller.probing, Probing)
    limits, estimate = make_limits(), replace(case.estimates[0], time=100.0)
    low = limits.inputs["air_flow"][0]
    assert not controller.probing.is_due(ProbeState(0.0), estimate, low + 1e-4)
    assert controller.probing.is_due(ProbeState(0.0), estimate, low + 3e-4)
    own, calls = controller.solver, 0

    def second_fails(arguments: FloatArray, *others: Any) -> NlpSolution:
        nonlocal calls
        calls += 1
        solution = own(arguments, *others)
        return solution if calls == 1 else replace(solution, validity=Validity.VIOLATED)

    monkeypatch.setattr(controller, "solver", second_fails)
    state = replace(controller.init(0.0), inputs=case.samples[0].inputs.copy())
    _, decision = controller.decide(state, replace(case.samples[0], time=100.0), estimate)
    assert calls == 2 and decision.status is Status.OK and decision.decided_by == "economic_mpc"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"most_cu_h": 0.0}, "most_cu_h must be positive"),
        ({"needed_std": -1.0}, "needed_std at least 0"),
        ({"amplitude": 1e-3}, "give at most 0.0002, the largest move"),
    ],
)
def test_options_outside_their_range_are_one_clear_line(options: dict[str, float], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        make(**options)
