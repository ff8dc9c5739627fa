"""Model: what its equations may and may not say, names, ranges, and the functions it builds."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.errors import ModelError, RangeError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Kind, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from benchmarks.timing import scipy_reference as reference

Equations = Callable[[Scope], None]


def tank(equations: Equations, algebraic: tuple[str, ...] = ()) -> Model:
    """A model with one or two of everything, for whatever equations."""
    return Model(
        name="tank",
        states=(Quantity("level", "m", "", 0.0, 2.0),),
        inputs=(Quantity("inflow", "m3/s", "", 0.0, 1.0), Quantity("valve", "-", "", 0.0, 1.0)),
        parameters=(
            Parameter("discharge", 0.5, "-", "", symbol="k", lower=0.0, upper=1.0),
            Parameter("size.small", 1.0, "m", ""),
            Parameter("size.large", 2.0, "m", ""),
        ),
        outputs=(Quantity("level", "m", ""),),
        algebraic=tuple(Quantity(name, "-", "") for name in algebraic),
        equations=equations,
    )


def good(m: Scope) -> None:
    m.derivative("level", m.input("inflow") - m.parameter("discharge") * m.state("level"))
    m.output("level", m.state("level"))


def also(addition: Callable[[Scope], object]) -> Equations:
    def equations(m: Scope) -> None:
        good(m)
        addition(m)

    return equations


def without_output(m: Scope) -> None:
    m.derivative("level", m.input("inflow"))


# -- equations ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        (lambda m: m.output("level", m.state("level")), "derivatives not given: level"),
        (without_output, "outputs not given: level"),
        (also(lambda m: m.derivative("level", ca.SX(0))), "derivative 'level' is given twice"),
        (also(lambda m: m.output("level", ca.SX(0))), "output 'level' is given twice"),
        (also(lambda m: m.output("depth", ca.SX(0))), "outputs not declared: depth"),
        (also(lambda m: m.signal("depth", ca.SX(0))), "signals not declared: depth"),
        (also(lambda m: m.derivative("levle", ca.SX(0))), "no 'levle' among the model's states; did you mean 'level'"),
        (also(lambda m: m.state("levle")), "no 'levle' among the model's states; did you mean 'level'"),
        (also(lambda m: m.input("inflo")), "no 'inflo' among the model's inputs; did you mean 'inflow'"),
        (also(lambda m: m.parameter("zzz")), "no 'zzz' among the model's parameters; known: discharge, size.large"),
        (also(lambda m: m.residual("z", ca.SX(0), ca.SX(0))), "no 'z' among the model's algebraic"),
    ],
)
def test_wrong_equations_are_refused_when_the_model_is_made(equations: Equations, message: str) -> None:
    with pytest.raises(ModelError) as error:
        tank(equations)
    assert message in str(error.value)


@pytest.mark.parametrize(("times", "message"), [(0, "residuals not given: z"), (2, "residual 'z' is given twice")])
def test_each_algebraic_variable_needs_one_residual(times: int, message: str) -> None:
    def equations(m: Scope) -> None:
        good(m)
        for _ in range(times):
            m.residual("z", m.algebraic("z") - 1, ca.SX(1))

    with pytest.raises(ModelError) as error:
        tank(equations, ("z",))
    assert message in str(error.value)


def test_site_returns_its_value_unchanged_and_is_recorded_once() -> None:
    """Without an effect a site is not there: same expression object, listed in the order of the equations."""
    seen: list[bool] = []

    def equations(m: Scope) -> None:
        for name in ("second", "first", "second"):
            value = m.parameter("discharge") * m.state("level")
            seen.append(m.site(name, value) is value)
        good(m)

    assert [s.name for s in tank(equations).sites] == ["second", "first"]
    assert seen == [True, True, True]


@given(x=st.floats(0.1, 2.0), t=st.floats(-3, 3), u=st.floats(0, 1))
def test_time_derivative_is_the_total_one(x: float, t: float, u: float) -> None:
    """d(x^2 sin t)/dt = 2 x dx/dt sin t + x^2 cos t: a filtered or controlled quantity may move with time as well."""

    def equations(m: Scope) -> None:
        m.derivative("level", m.input("inflow") - m.state("level"))
        m.output("level", m.time_derivative(m.state("level") ** 2 * ca.sin(m.time)))

    p = np.ones(3)
    y = FastCall(tank(equations).ode)(t, x, [u, 0.0], p)[1]  # type: ignore[arg-type]
    assert y[0] == pytest.approx(2 * x * (u - x) * np.sin(t) + x**2 * np.cos(t), abs=1e-12)


# -- names and values --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "name", "index"),
    [("inputs", "valve", 1), ("parameters", "k", 0), ("parameters", "discharge", 0), ("parameters", "size.large", 2)],
)
def test_index_finds_names_and_parameter_symbols(kind: Kind, name: str, index: int) -> None:
    assert tank(good).index(kind, name) == index


def test_unknown_name_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(ModelError, match="'tank' has no 'dischrge' among its parameters; did you mean 'discharge'"):
        tank(good).index("parameters", "dischrge")


def test_groups_and_symbols_expand_to_full_names() -> None:
    assert tank(good).expand_parameters(["size", "k"]) == ("size.small", "size.large", "discharge")
    for twice in (["k", "discharge"], ["size", "size.small"], ["k", "k"]):
        with pytest.raises(ModelError, match="is named twice"):
            tank(good).expand_parameters(twice)
    with pytest.raises(ModelError, match="no 'sizes'"):
        tank(good).expand_parameters(["sizes"])


@pytest.mark.parametrize(
    ("unit", "column"),
    [("-", "q"), ("1", "q"), ("", "q"), ("m3/s", "q_m3_s"), ("Pa s", "q_Pa_s"), ("V^0.5/s", "q_V^0.5_s")],
)
def test_column_name_carries_the_unit(unit: str, column: str) -> None:
    assert Quantity("q", unit, "").column == column


def test_parameters_are_replaced_in_a_copy() -> None:
    model = tank(good)
    changed = model.with_parameters({"k": 0.25, "size.large": 3.0})
    assert changed.ode is model.ode  # nothing is built again
    np.testing.assert_array_equal(changed.parameter_values, [0.25, 1.0, 3.0])
    np.testing.assert_array_equal(model.parameter_values, [0.5, 1.0, 2.0])


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan"), float("inf")])
def test_parameter_outside_its_range_is_refused(value: float) -> None:
    with pytest.raises(RangeError, match=r"'discharge' = \S+ - is outside its physical range \[0, 1\]"):
        tank(good).with_parameters({"discharge": value})


@pytest.mark.parametrize(("beyond", "kept"), [(1.0 + 1e-12, 1.0), (1.0 - 1e-12, 1.0 - 1e-12)])
def test_a_value_a_rounding_error_beyond_its_range_is_at_its_end(beyond: float, kept: float) -> None:
    """A fit at a bound comes back with the last digit off; a record of other processes ended with an error by it."""
    parameter = Parameter("discharge", 0.5, "-", "", lower=0.0, upper=1.0)
    assert parameter.with_value(beyond).value == kept
    with pytest.raises(RangeError):
        parameter.with_value(1.0 + 1e-6)


def test_unknown_parameter_is_refused() -> None:
    with pytest.raises(ModelError, match="did you mean 'discharge'"):
        tank(good).with_parameters({"discharg": 0.1})


@pytest.mark.parametrize("bad", [-0.1, 1.1, float("nan")])
def test_inputs_outside_their_range_are_refused(bad: float) -> None:
    """Named: the place, the input, the value, the row or the time, the range."""
    table = np.full((4, 2), 0.5)
    model = tank(good)
    model.check_inputs(table)
    table[2, 1] = bad
    with pytest.raises(RangeError, match=rf"inputs: valve = {bad:g} - at row 2 .* \[0, 1\]"):
        model.check_inputs(table)
    with pytest.raises(RangeError, match=r"file\.csv: valve = .* at time 20 s"):
        model.check_inputs(table, np.arange(4.0) * 10, "file.csv")


def test_inputs_at_their_limits_are_taken() -> None:
    tank(good).check_inputs(np.array([[0.0, 1.0], [1.0, 0.0]]))


def test_wrong_number_of_inputs_is_refused() -> None:
    with pytest.raises(ModelError, match="3 columns, but the model has 2 inputs"):
        tank(good).check_inputs(np.zeros((5, 3)))


# -- functions ---------------------------------------------------------------------------------------------------------


@given(x=st.floats(0.2, 4.0))
def test_algebraic_loop_with_two_unknowns_is_closed_inside(two_unknowns: Model, x: float) -> None:
    """The equations are given in another order than the variables and are coupled: a = x^0.5, b = x^1.5."""
    xdot, y, _, z = FastCall(two_unknowns.ode)(0.0, x, 0.0, 0.5)
    np.testing.assert_allclose(z, [x**0.5, x**1.5], rtol=1e-10)
    np.testing.assert_allclose([xdot[0], y[0]], [-0.5 * x**1.5, x], rtol=1e-10)


@given(
    air=st.floats(9.05e-4, 2.17e-3),
    level=st.floats(0.345, 0.42),
    move=arrays(float, 9, elements=st.floats(-0.03, 0.03)),
)
def test_newton_steps_close_the_loop_of_the_cell(model: Model, air: float, level: float, move: FloatArray) -> None:
    """What is left is below 1e-8 of the gas velocity, in the operating range and 3 % around its steady states."""
    p, u = model.parameter_values, np.array([air, 1.67e-4, level])
    x = steady_state(model, u).state * (1 + move)
    z = FastCall(model.ode)(0.0, x, u, p)[3]
    residual = FastCall(model.dae)(0.0, x, u, p, z)[1]
    assert abs(residual[0] / z[0]) < 1e-8


def test_newton_steps_close_the_loop_with_small_bubbles_too(model: Model) -> None:
    """n and C 20 % below nominal, air and level within their limits: a thick overflow, far from the first guess."""
    u, changed = np.array([2.15e-3, 1.8e-4, 0.412]), model.with_parameters({"n": 0.8, "C": 5.2e-4})
    p = changed.parameter_values
    x = reference.steady_state(u, np.array([0.8, 5.2e-4]))
    z = FastCall(model.ode)(0.0, x, u, p)[3]
    assert z[0] == pytest.approx(u[0] / p[0], rel=1e-8)


@given(seed=st.integers(0, 1000))
def test_tangent_is_the_derivative_of_the_closed_equations(model: Model, seed: int) -> None:
    """Along a random direction in states and parameters, z moving along; against central differences."""
    rng = np.random.default_rng(seed)
    u, p = np.array([1.5e-3, 1.67e-4, 0.38]), model.parameter_values
    x = steady_state(model, u).state * rng.uniform(0.95, 1.05, 9)
    dx, dp = x * rng.uniform(-1, 1, x.size), p * rng.uniform(-1, 1, p.size)
    ode = FastCall(model.ode)
    rates, y, decay = FastCall(model.tangent(ca.DM(dp)))(0.0, x, u, p, dx)[3:]
    h = 1e-6
    ahead, behind = (ode(0.0, x + s * h * dx, u, p + s * h * dp) for s in (1, -1))
    scale = np.abs(x)
    np.testing.assert_allclose(rates / scale, (ahead[0] - behind[0]) / (2 * h) / scale, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(y, (ahead[1] - behind[1]) / (2 * h), rtol=1e-5, atol=1e-10)
    fast = FastCall(model.decay)
    ahead_decay, behind_decay = (
        fast(0.0, x + s * h * dx, u, p + s * h * dp, z[3])[0] for s, z in ((1, ahead), (-1, behind))
    )
    np.testing.assert_allclose(decay, (ahead_decay - behind_decay) / (2 * h), rtol=1e-5, atol=1e-8)


def test_a_model_prints_as_one_short_line(model: Model) -> None:
    """A notebook that ends a cell with a model shows what it is, not every parameter and its source."""
    effect = Effect("grade_sensor", "constant", "shift")
    text = repr(model.with_effects([effect]))
    assert text.startswith("<Model name: flotation; states: tails_flow, level, ")
    assert text.endswith("; effects: grade_sensor_by_constant>")
    assert len(text) < 500


def test_effects_of_one_kind_share_their_equations_and_keep_their_own_values(model: Model) -> None:
    """Only the values of the coefficients may differ; another setting is another kind."""

    def extended(reference: float, exponent: float) -> Model:
        settings, values = {"reference": reference}, {"exponent": exponent}
        return model.with_effects([Effect("bubble_size", "air_flow", "power", values, settings)])

    one, other, third = extended(1e-3, 0.2), extended(1e-3, 0.4), extended(2e-3, 0.2)
    assert one.ode is other.ode and one.ode is not third.ode
    assert [m.fitted_effects()[0].coefficients["exponent"] for m in (one, other, third)] == [0.2, 0.4, 0.2]
    assert not model.effects and one.effects != other.effects
    moved = model.with_parameters({model.parameters[0].name: model.parameters[0].value * 1.01})
    again = moved.with_effects(one.effects)
    assert again.ode is one.ode and again.parameters[0] == moved.parameters[0]
