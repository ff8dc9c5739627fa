"""Steady states: against the closed-form solution of the SciPy reference, their gradient, and clear failure."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.steady.steady_state import steady_state, steady_state_gradient
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from benchmarks.timing import scipy_reference as reference

NOMINAL = np.array([1.5e-3, 1.67e-4, 0.38])
operating_point = st.tuples(st.floats(9.05e-4, 2.17e-3), st.floats(1e-4, 3e-4), st.floats(0.345, 0.42)).map(np.array)
froth = st.tuples(st.floats(1.0, 1.25), st.floats(6e-4, 8e-4)).map(np.array)


def with_froth(model: Model, theta: FloatArray) -> FloatArray:
    p = model.parameter_values
    p[model.indices("parameters", ["n", "C"])] = theta
    return p


@given(operating_point, froth)
def test_steady_state_is_the_one_of_the_reference(model: Model, u: FloatArray, theta: FloatArray) -> None:
    """The reference solves it class by class in closed form, from h_p = h_p_SP and v_g* A = Q_air."""
    found = steady_state(model, u, with_froth(model, theta))
    np.testing.assert_allclose(found.state, reference.steady_state(u, theta), rtol=1e-8)


@given(operating_point, froth)
def test_rates_vanish(model: Model, u: FloatArray, theta: FloatArray) -> None:
    """And the residual that is reported is the one that is left, in scales of the states."""
    p = with_froth(model, theta)
    found = steady_state(model, u, p)
    rates = FastCall(model.ode)(0.0, found.state, u, p)[0] / [q.scale for q in model.states]
    assert np.max(np.abs(rates)) < 1e-9
    assert found.residual == pytest.approx(np.max(np.abs(rates)), abs=1e-12)


def test_default_parameters_are_those_of_the_model(model: Model) -> None:
    changed = model.with_parameters({"n": 1.1})
    p = with_froth(model, np.array([1.1, model.parameter_values[model.index("parameters", "C")]]))
    np.testing.assert_array_equal(steady_state(changed, NOMINAL).state, steady_state(model, NOMINAL, p).state)


def test_default_guess_reaches_every_corner_of_the_operating_range(model: Model) -> None:
    """The limits of the paper: air 9.05e-4 to 2.17e-3 m3/s, level 0.33 to 0.42 m."""
    for air in (9.05e-4, 2.17e-3):
        for level in (0.33, 0.42):
            u = np.array([air, 1.67e-4, level])
            np.testing.assert_allclose(
                steady_state(model, u).state, reference.steady_state(u, reference.THETA_NOMINAL), rtol=1e-8
            )


def test_a_guess_is_used(model: Model) -> None:
    """From a good guess the steady state of a point far from the default guess is found."""
    u = np.array([9.05e-4, 1.67e-4, 0.30])
    expected = reference.steady_state(u, reference.THETA_NOMINAL)
    np.testing.assert_allclose(steady_state(model, u, guess=expected * 1.001).state, expected, rtol=1e-8)


@pytest.mark.parametrize("air", [9.5e-4, 1.5e-3, 2.1e-3])
def test_gradient_is_that_of_the_solution(model: Model, air: float) -> None:
    """Implicit function theorem against central differences of the solved steady state."""
    names = ["n", "C", "cross_section_area", "floatability.chalcopyrite", "integral_time"]
    u, p = np.array([air, 1.67e-4, 0.37]), model.parameter_values
    state = steady_state(model, u).state
    gradient = steady_state_gradient(model, state, u, p, names)
    for column, i in zip(gradient.T, model.indices("parameters", names), strict=True):
        h = np.zeros(p.size)
        h[i] = 1e-5 * p[i]
        difference = steady_state(model, u, p + h, state).state - steady_state(model, u, p - h, state).state
        np.testing.assert_allclose(column * p[i] / state, difference / (2 * h[i]) * p[i] / state, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize(
    ("u", "where"),
    [
        ([1.5e-3, 1.67e-4, 0.6], "level_setpoint = 0.6 m"),
        ([1.5e-3, 0.0, 0.38], "feed_flow = 0 m3/s"),
        ([1.0e-5, 1.67e-4, 0.38], "air_flow = 1e-05 m3/s"),
        ([float("nan"), 1.67e-4, 0.38], "air_flow = nan m3/s"),
    ],
    ids=["level above the cell", "nothing fed", "froth does not overflow", "input not finite"],
)
def test_failure_is_a_range_error_that_names_the_inputs(model: Model, u: list[float], where: str) -> None:
    """Neither a warning nor a state outside the physical range."""
    with pytest.raises(RangeError, match="'flotation' has no steady state within its physical range") as error:
        steady_state(model, np.array(u))
    assert where in str(error.value)


def test_a_model_that_depends_on_time_is_taken_at_a_time(model: Model) -> None:
    """Before the onset of a step the nominal steady state, after it that of a constant shift of the same size."""
    stepped = model.with_effects([Effect("coalescence", "time", "step", {"amplitude": 0.2, "onset": 1000.0})])
    shifted = model.with_effects([Effect("coalescence", "constant", "shift", {"amplitude": 0.2})])
    for time, expected in ((0.0, model), (2000.0, shifted)):
        found = steady_state(stepped, NOMINAL, time=time).state
        np.testing.assert_allclose(found, steady_state(expected, NOMINAL).state, rtol=1e-9)
    found, expected_gradient = (
        steady_state_gradient(m, steady_state(shifted, NOMINAL).state, NOMINAL, m.parameter_values, ["n"], 2000.0)
        for m in (stepped, shifted)
    )
    np.testing.assert_allclose(found, expected_gradient, rtol=1e-9)


@pytest.mark.parametrize("looped", [False, True])
def test_a_state_that_nothing_moves_stays(looped: bool) -> None:
    """A valve s within its band: x = k s with s held; in a loop that asks for x = 1, s is what can give way."""

    def equations(m: Scope) -> None:
        x, s, w = m.state("x"), m.state("s"), m.state("w")
        m.derivative("x", m.parameter("k") * s - x)
        m.derivative("s", 0 * s)
        m.derivative("w", x - 1 if looped else s - w)
        m.output("y", x)

    names = ("x", "s", "w")
    own = Model(
        "valve",
        tuple(Quantity(n, "-", "") for n in names),
        (Quantity("u", "-", ""),),
        (Parameter("k", 0.5, "-", ""),),
        (Quantity("y", "-", ""),),
        equations,
    )
    gradient = steady_state_gradient(own, np.array([1.0, 2.0, 2.0]), np.zeros(1), np.array([0.5]), ["k"])[:, 0]
    np.testing.assert_allclose(gradient, [0.0, -4.0, 0.0] if looped else [2.0, 0.0, 0.0], atol=1e-12)
