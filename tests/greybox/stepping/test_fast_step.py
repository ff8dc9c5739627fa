"""The fast step: exact on the decay it is told of, order four on the rest, its derivative that of the step itself."""

from collections.abc import Callable, Mapping
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation


def one_state(rate: Callable[[Scope], ca.SX], decay: Callable[[Scope], ca.SX] | None) -> Model:
    """dx/dt = rate, with a decay rate given or not; y = x."""

    def equations(m: Scope) -> None:
        m.derivative("x", rate(m), decay(m) if decay else None)
        m.output("y", m.state("x"))

    return Model(
        name="one-state",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("k", 1.0, "1/s", ""),),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def linear(m: Scope) -> ca.SX:
    return m.input("u") - m.parameter("k") * m.state("x")


def logistic(m: Scope) -> ca.SX:
    return m.parameter("k") * m.state("x") * (1 - m.state("x"))


def minus_k(m: Scope) -> ca.SX:
    return -m.parameter("k")


def moving_decay(m: Scope) -> ca.SX:
    return -m.parameter("k") * m.state("x")


@given(k=st.floats(1e-9, 1.0), u=st.floats(-1, 1), x=st.floats(-1, 1))
def test_decay_is_integrated_exactly(k: float, u: float, x: float) -> None:
    """dx/dt = u - k x in one step of 1 s, and dx/dk and dx/dx0 with it; no cancellation where k is tiny."""
    found = Stepper(one_state(linear, minus_k), 1.0, substeps=1).simulate_sensitivities(
        np.array([x]), np.array([[u]]), np.array([k]), ["k"], np.array([[0.0, 1.0]])
    )
    share = -np.expm1(-k) / k  # (1 - exp(-k)) / k, its slope by series below 1e-3
    slope = (np.exp(-k) - share) / k if k > 1e-3 else -0.5 + k / 3 - k**2 / 8
    assert found.outputs[0, 0] == pytest.approx(x * np.exp(-k) + u * share, abs=1e-12)
    assert found.gradient[0, 0, 0] == pytest.approx(-x * np.exp(-k) + u * slope, abs=1e-8)
    assert found.gradient[0, 0, 1] == pytest.approx(np.exp(-k), abs=1e-12)


def test_decay_up_to_four_steps_keeps_the_documented_accuracy() -> None:
    """As the series is documented: 1e-4 at |decay| h = 4, where the classical method is unstable."""
    run = Stepper(one_state(linear, minus_k), 1.0, substeps=1).simulate(
        np.array([1.0]), np.zeros((1, 1)), np.array([4.0])
    )
    assert run.states[0, 0] == pytest.approx(np.exp(-4), abs=1e-4)


@pytest.mark.parametrize("decay", [None, minus_k, moving_decay], ids=["no decay", "constant", "moving with the state"])
def test_halving_the_step_shows_order_four(decay: Callable[[Scope], ca.SX] | None) -> None:
    """Whatever is given as decay, right or wrong, the solution and the order stay the same: logistic growth."""
    model = one_state(logistic, decay)
    truth = 1 / (1 + 9 * np.exp(-np.arange(1, 7)))
    error = []
    for substeps in (2, 4):
        run = Stepper(model, 1.0, substeps=substeps).simulate(np.array([0.1]), np.zeros((6, 1)))
        error.append(np.max(np.abs(run.outputs[:, 0] - truth)))
    assert error[1] < 1e-4
    assert 12 < error[0] / error[1] < 24


@pytest.mark.parametrize("decay", [None, minus_k, moving_decay], ids=["no decay", "constant", "moving with the state"])
def test_gradient_is_that_of_the_step_and_not_of_the_solution(decay: Callable[[Scope], ca.SX] | None) -> None:
    """On one coarse step the two differ; the derivative of the weights, which move with k and x, belongs to it."""
    stepper = Stepper(one_state(logistic, decay), 2.0, substeps=1)

    def end(k: float, x: float) -> float:
        return float(stepper.simulate(np.array([x]), np.zeros((1, 1)), np.array([k])).outputs[0, 0])

    found = stepper.simulate_sensitivities(
        np.array([0.3]), np.zeros((1, 1)), np.array([1.0]), ["k"], np.array([[0.0, 1.0]])
    )
    h = 1e-5
    differences = [
        (end(1 + h, 0.3) - end(1 - h, 0.3)) / (2 * h),
        (end(1.0, 0.3 + h) - end(1.0, 0.3 - h)) / (2 * h),
    ]
    np.testing.assert_allclose(found.gradient[0, 0], differences, rtol=1e-8)


@pytest.mark.parametrize("substeps", [2, 4])
def test_halving_the_step_of_the_cell_shows_order_four(model: Model, accurate: Stepper, substeps: int) -> None:
    x0 = steady_state(model, np.array([1.5e-3, 1.67e-4, 0.38])).state
    u = np.tile([2.0e-3, 1.5e-4, 0.40], (10, 1))
    truth = accurate.simulate(x0, u).states
    coarse, fine = (
        np.max(np.abs(Stepper(model, 1.0, substeps=n).simulate(x0, u).states / truth - 1))
        for n in (substeps, 2 * substeps)
    )
    assert fine < 1e-6
    assert 12 < coarse / fine < 24


@pytest.mark.parametrize(("dt", "substeps"), [(0.1, 1), (1.0, 1), (1.2, 2), (30.0, 30)])
def test_steps_are_as_long_as_the_model_allows(model: Model, dt: float, substeps: int) -> None:
    assert model.max_step_s == 1.0
    assert Stepper(model, dt).substeps == substeps


def test_fast_step_of_a_cell_with_larger_bubbles(write_cell: Callable[[Mapping[str, object]], Path]) -> None:
    """2.5 mm leaves the pulp at 2.6 m/s: decay 7 /s. The cell file allows it, the accurate step integrates it."""
    cell = flotation.make_model(
        flotation.read_cell(write_cell({"bubbles.diameter.value": [2e-4, 4e-4, 6e-4, 8e-4, 2.5e-3]}))
    )
    x0 = steady_state(cell, np.array([1.5e-3, 1.67e-4, 0.38])).state
    u = np.tile([[1.0e-3, 1.5e-4, 0.40], [2.0e-3, 1.5e-4, 0.40]], (10, 1))
    truth = Stepper(cell, 1.0, accurate=True).simulate(x0, u).states
    np.testing.assert_allclose(Stepper(cell, 1.0).simulate(x0, u).states, truth, rtol=1e-3)
