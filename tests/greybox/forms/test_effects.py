"""Effects: nothing at amplitude zero (to the bit), the stated law elsewhere, named errors."""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.catalogue import FORMS
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation

SETTINGS: dict[str, dict[str, float | tuple[float, ...]]] = {
    "power": {"reference": 1.5e-3},
    "linear": {"reference": 1.5e-3},
    "curve": {"knots": (1.0e-3, 1.3e-3, 1.6e-3, 1.9e-3)},
    "polyline": {"knots": (1.0e-3, 1.2e-3, 1.6e-3, 1.9e-3)},
    "hinge": {"reference": 1.5e-3},
    "limited_line": {"knots": (1.0e-3, 1.9e-3)},
    "limited_factor": {"knots": (1.0e-3, 1.9e-3)},
    "direction": {"scale": 1.5e-3},
    "cubic": {"knots": (1.0e-3, 1.9e-3)},
    "span": {"middle": 1.5e-3},
    "lag": {"scale": 1e-6},
    "lags": {"scale": 1e-6},
    "held": {"scale": 1e-6},
    "delay": {"scale": 1e-6},
    "stiction": {"scale": 1e-6},
    "slip_jump": {"scale": 1e-6},
}
DRIVERS = {"signal": "air_flow"}
ONCE = "concentrate_flow"  # a site that the equations pass once, so that forms with states may act there


def effect(form: str, site: str = ONCE, **coefficients: float) -> Effect:
    kind = FORMS[form].drivers[0]
    return Effect(site, DRIVERS.get(kind, kind), form, coefficients, SETTINGS.get(form, {}))


@pytest.fixture(scope="module")
def cell() -> Model:
    return flotation.make_model()


def inputs(rows: int) -> np.ndarray:
    k = np.arange(rows)
    return np.column_stack([1.5e-3 + 3e-4 * np.sin(k / 20), 1.67e-4 + 0 * k, 0.37 + 0.01 * np.cos(k / 30)])


@pytest.mark.parametrize("form", FORMS)
def test_an_effect_of_amplitude_zero_is_the_nominal_model_to_the_bit(cell: Model, form: str) -> None:
    u = inputs(60)
    extended = cell.with_effects([effect(form)])
    cell = replace(cell, max_step_s=extended.longest_step_s)
    base = Stepper(cell, 1.0).simulate(steady_state(cell, u[0]).state, u)
    found = Stepper(extended, 1.0).simulate(steady_state(extended, u[0]).state, u)
    start = base.states[0]
    again = Stepper(extended, 1.0).simulate(np.concatenate([start, np.zeros(len(extended.states) - 9)]), u[1:])
    once = Stepper(cell, 1.0).simulate(start, u[1:])
    assert np.array_equal(again.outputs, once.outputs)
    assert np.array_equal(again.states[:, :9], once.states)
    np.testing.assert_allclose(found.outputs, base.outputs, rtol=1e-7)


def test_a_power_law_multiplies_the_quantity_as_written(cell: Model) -> None:
    """A power of air at the air flow's own site, exponent 1 at twice the reference, is twice the air."""
    u = np.array([1.2e-3, 1.67e-4, 0.37])
    doubled = cell.with_effects([Effect("air_flow", "air_flow", "power", {"exponent": 1.0}, {"reference": 0.6e-3})])
    expected = steady_state(cell, np.array([2.4e-3, 1.67e-4, 0.37])).state
    np.testing.assert_allclose(steady_state(doubled, u).state, expected, rtol=1e-8)


def test_a_sensor_offset_moves_one_output_only(cell: Model) -> None:
    u = inputs(30)
    x0 = steady_state(cell, u[0]).state
    base = Stepper(cell, 1.0).simulate(x0, u).outputs
    shifted = Stepper(cell.with_effects([effect("shift", "grade_sensor", amplitude=0.01)]), 1.0).simulate(x0, u).outputs
    np.testing.assert_allclose(shifted[:, 0] - base[:, 0], 0.01, atol=1e-15)
    assert np.array_equal(shifted[:, 1:], base[:, 1:])


def test_a_curve_passes_through_its_values_at_the_knots(cell: Model) -> None:
    knots = (1.0e-3, 1.3e-3, 1.6e-3, 1.9e-3)
    values = (0.1, -0.2, 0.3, 0.05)
    curve = Effect(
        "grade_sensor",
        "air_flow",
        "curve",
        {f"value_{k + 1}": v for k, v in enumerate(values)},
        {"knots": knots},
    )
    extended = cell.with_effects([curve])
    for knot, value in zip(knots, values, strict=True):
        u = np.array([knot, 1.67e-4, 0.37])
        x = steady_state(cell, u).state
        got, base = (Stepper(m, 1.0).outputs_at(x, 0.0, u, m.parameter_values)[0] for m in (extended, cell))
        assert got - base == pytest.approx(value, abs=1e-12)


def test_a_delay_of_a_ramp_is_late_by_its_dead_time() -> None:
    """On a steady ramp a chain of lags is late by exactly the sum of their time constants."""
    cell = flotation.make_model()
    u = inputs(1)
    late = cell.with_effects(
        [Effect("feed_flow", "delay", "delay", {"amplitude": 1.0, "dead_time": 24.0}, {"scale": 1.67e-4})]
    )
    ramp = np.tile(u, (400, 1))
    ramp[:, 1] = 1.67e-4 + 1e-8 * np.arange(400)
    x0 = steady_state(late, ramp[0]).state
    states = Stepper(late, 1.0).simulate(x0, ramp).states
    last = late.index("states", "feed_flow_by_delay.stage_12")
    assert (ramp[-1, 1] - 1.67e-4 * states[-1, last]) / 1e-8 == pytest.approx(
        24.0, abs=0.6
    )  # held inputs: half a sample


def test_a_step_far_ahead_has_finite_derivatives(cell: Model) -> None:
    """An onset an hour ahead: the step's slope there is zero, not a quotient of two overflows."""
    later = cell.with_effects([Effect("coalescence", "time", "step", {"amplitude": 0.2, "onset": 3600.0})])
    u = inputs(1)[0]
    step = Stepper(later, 1.0).one_step_gradient(["n", "coalescence_by_time.amplitude", "coalescence_by_time.onset"])
    gradient = np.array(step(steady_state(later, u).state, 0.0, u, later.parameter_values)[2])
    assert np.isfinite(gradient).all() and gradient[0, 0] != 0 and not gradient[:, 1:].any()


def test_coefficients_have_the_units_of_their_site_and_driver(cell: Model) -> None:
    """A factor is dimensionless, an offset has the site's unit, a threshold the driver's."""
    added = cell.with_effects(
        [
            effect("shift", "grade_sensor"),
            effect("shift", "level_sensor"),
            effect("shift", "coalescence"),
            Effect("concentrate_flow", "level", "overflow"),
        ]
    )
    units = {p.name: p.unit for p in added.parameters}
    assert units["grade_sensor_by_constant.amplitude"] == "-"
    assert units["level_sensor_by_constant.amplitude"] == "m"
    assert units["coalescence_by_constant.amplitude"] == "-"
    assert units["concentrate_flow_by_level.threshold"] == "m"
    assert units["concentrate_flow_by_level.gain"] == "m3/s/m"


def test_without_effects_is_the_model_before(cell: Model) -> None:
    """Own parameters keep new values; states and coefficients of the effects are gone."""
    extended = cell.with_effects([effect("lag"), effect("power", "bubble_size")]).with_parameters({"n": 1.1})
    back = extended.without_effects()
    assert back.names("states") == cell.names("states") and back.effects == ()
    assert back.parameters == cell.with_parameters({"n": 1.1}).parameters


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda m: m.with_effects([effect("shift", "bubble_siz")]), "bubble_size"),
        (lambda m: m.with_effects([Effect("burst_rate", "air_flo", "power", {}, {"reference": 1.0})]), "air_flow"),
        (
            lambda m: m.with_effects([Effect("burst_rate", "froth_bubble_size", "linear", {}, {"reference": 1.0})]),
            "not known",
        ),
        (lambda m: m.with_effects([effect("lag", "bubble_size")]), "components"),
        (lambda m: m.with_effects([effect("shift"), effect("shift")]), "two effects"),
        (lambda m: Effect("burst_rate", "air_flow", "powr"), "power"),
        (lambda m: Effect("burst_rate", "air_flow", "power"), "reference"),
        (lambda m: effect("power", exponnt=1.0), "exponent"),
        (lambda m: effect("lag", amplitude=2.0), "outside"),
        (lambda m: Effect("burst_rate", "air_flow", "power", {}, {"reference": 0.0}), "positive"),
        (lambda m: Effect("burst_rate", "air_flow", "power", {}, {"reference": (1.0, 2.0)}), "one positive number"),
        (lambda m: Effect("burst_rate", "air_flow", "curve", {}, {"knots": (1e-3, 1e-3)}), "rise"),
        (lambda m: Effect("feed_flow", "delay", "delay", {}, {"scale": 1e-4, "stages": 2.5}), "whole"),
    ],
)
def test_a_wrong_effect_is_one_clear_error(cell: Model, wrong: Callable[[Model], object], says: str) -> None:
    with pytest.raises(ModelError, match=says):
        wrong(cell)


def test_a_cubic_law_is_the_polynomial_as_written() -> None:
    """From -1 to 1 between the knots, and further beyond them: NumPy's polynomial is the reference."""
    knots, coefficients = (2.0, 6.0), {"amplitude": 0.5, "slope": -1.0, "square": 0.25, "cube": 2.0}
    law = FORMS["cubic"].static
    assert law is not None
    d, c = ca.SX.sym("d"), {n: ca.SX(v) for n, v in coefficients.items()}
    found = ca.Function("g", [d], [law(d, c, {"knots": knots})])
    for driver in (0.0, 2.0, 4.0, 5.5, 9.0):
        expected = np.polynomial.Polynomial(list(coefficients.values()))((driver - 4.0) / 2.0)
        assert float(found(driver)) == pytest.approx(expected, rel=1e-12)
