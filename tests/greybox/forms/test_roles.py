"""Protects: what a form says of itself is what its law does, and a form without amplitude is the nominal model."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox import Effect, Model, Quantity, Scope
from adaptive_flot.greybox.forms.catalogue import FORMS
from adaptive_flot.greybox.forms.form import Coefficient, CoefficientRole, Form, FormKind

KNOTS = (-1.0, 0.5, 2.0, 4.0)
NEEDED: dict[str, float | tuple[float, ...]] = {"reference": 2.0, "scale": 3.0, "knots": KNOTS, "middle": 2.0}
"""Settings that some forms ask for."""
DRIVERS = {"signal": "drive"}
NUMBERS = st.floats(-1e6, 1e6, allow_subnormal=False)


def equations(m: Scope) -> None:
    value = m.site("place", m.input("value"), "flow")
    m.derivative("store", value - m.state("store"))
    m.output("value", value)


MODEL = Model(
    name="plain",
    states=(Quantity("store", "-", ""),),
    inputs=(Quantity("value", "-", ""), Quantity("drive", "-", "")),
    parameters=(),
    outputs=(Quantity("value", "-", ""),),
    equations=equations,
)


def effect(form: Form, coefficients: dict[str, float], mode: str = "factor") -> Effect:
    kind = form.drivers[0]
    given_settings = {name: NEEDED[name] for name, default in form.settings.items() if default is None}
    return Effect("place", DRIVERS.get(kind, kind), form.name, coefficients, given_settings, mode)  # type: ignore[arg-type]


def terms(form: Form) -> tuple[Coefficient, ...]:
    return effect(form, {}).terms


def output(e: Effect, value: float, drive: float, time: float, own: float) -> float:
    """Output of the model with an effect; the states of the effect are `own`."""
    model = MODEL.with_effects([e])
    states = np.concatenate([[1.0], np.full(len(model.states) - 1, own)])
    return float(model.ode(time, states, [value, drive], model.parameter_values)[1])


def inside(c: Coefficient) -> st.SearchStrategy[float]:
    return st.floats(max(c.lower, -1e4), min(c.upper, 1e4), allow_subnormal=False)


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("mode", ["factor", "offset"])
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_without_amplitude_a_form_of_any_shape_is_the_nominal_model_to_the_bit(
    name: str, mode: str, data: st.DataObject
) -> None:
    """Onsets, time constants and thresholds may be anything, and so may the states of the effect."""
    form = FORMS[name]
    shape = {c.name: data.draw(inside(c), c.name) for c in terms(form) if c.is_shape}
    value, drive, own = (data.draw(NUMBERS, n) for n in ("value", "drive", "own"))
    time = data.draw(st.floats(0.0, 1e6), "time")
    assert output(effect(form, shape, mode), value, drive, time, own) == value


# each amplitude alone, at a value, driver, time and state where the law of every form is awake
AT = {"value": 5.0, "drive": 3.0, "time": 900.0, "own": 0.5}
AWAKE = {CoefficientRole.ONSET: 100.0, CoefficientRole.THRESHOLD: 1.0, CoefficientRole.LIMIT: 2.0}
AWAKE |= {
    CoefficientRole.FLOOR: 8.0,
    CoefficientRole.POSITION: 2.0,
    CoefficientRole.BAND: 4.0,
    CoefficientRole.REST: 0.5,
    CoefficientRole.PERIOD: 70.0,
}


@pytest.mark.parametrize("name", FORMS)
def test_each_amplitude_switches_its_form_on(name: str) -> None:
    """What is declared as an amplitude and not as a shape has an effect by itself."""
    form = FORMS[name]
    shape = {c.name: AWAKE[c.role] for c in terms(form) if c.role in AWAKE}
    amplitudes = [c for c in terms(form) if not c.is_shape]
    assert amplitudes
    for c in amplitudes:
        changed = [output(effect(form, {**shape, c.name: 0.5}), 5.0, drive, 900.0, 0.5) for drive in (3.0, 0.7, -0.5)]
        assert any(abs(y - 5.0) > 1e-6 for y in changed), c.name


@pytest.mark.parametrize("name", FORMS)
def test_every_coefficient_has_a_role_that_fits_the_kind_of_its_form(name: str) -> None:
    """Who asks a form for its onset or its levels gets what the kind promises."""
    form = FORMS[name]
    roles = [c.role for c in terms(form)]
    assert all(isinstance(role, CoefficientRole) for role in roles)
    assert (CoefficientRole.ONSET in roles) == form.is_event
    assert (set(roles) == {CoefficientRole.KNOT_VALUE}) == form.is_curve
    assert (CoefficientRole.THRESHOLD in roles) == (form.kind is FormKind.THRESHOLD)
    assert (CoefficientRole.LIMIT in roles) == (form.kind is FormKind.LIMIT)
    assert bool(effect(form, {}).states()) == form.has_memory
    assert (form.drivers == ("constant",)) == form.is_constant
    assert (form.drivers == ("time",)) == (form.is_event or form.kind is FormKind.PERIODIC)
    for c in terms(form):
        assert not (c.is_level and form.static is None), "a level is a number g of a static law"
        assert c.is_shape or c.default == 0.0


@pytest.mark.parametrize("name", FORMS)
def test_a_form_is_linear_where_it_says_so(name: str) -> None:
    """Against the derivatives of its law: the Hessian of the change for all coefficients is zero, or is not."""
    form = FORMS[name]
    e = effect(form, {})
    c = ca.SX.sym("c", len(e.terms))
    drive = ca.SX.sym("drive")
    if form.has_memory:
        assert not form.is_linear
        return
    coefficients = {t.name: c[i] for i, t in enumerate(e.terms)}
    if form.static is not None:
        g = ca.SX(form.static(drive, coefficients, e.full_settings))
    else:
        assert form.direct is not None
        g = form.direct(None, ca.SX(5.0), drive, coefficients, e.full_settings)  # type: ignore[arg-type]
    curvature = ca.Function("h", [drive, c], [ca.hessian(g, c)[0]])
    roles = [t.role for t in e.terms]
    awake = {r: v for r, v in AWAKE.items() if roles.count(r) < 2}  # two thresholds stay apart, as they are by default
    at = [awake.get(t.role, 0.5 if not t.is_shape else t.default or 700.0) for t in e.terms]
    driver = 101.0 if form.is_event else 3.0  # just after the onset, where a step is still on its way
    assert bool(np.any(np.abs(np.array(curvature(driver, at))) > 1e-12)) != form.is_linear


def test_values_come_by_role() -> None:
    ramp = Effect("place", "time", "ramp", {"duration": 60.0, "amplitude": 0.3, "onset": 20.0})
    assert ramp.levels == [0.3]
    assert ramp.values(CoefficientRole.ONSET, CoefficientRole.DURATION) == [60.0, 20.0]  # in the order given
    assert ramp.names(CoefficientRole.ONSET, CoefficientRole.DURATION) == ("onset", "duration")  # in that of the form
    assert ramp.values(CoefficientRole.TIME_CONSTANT) == []
    curve = Effect("place", "drive", "curve", {"value_2": 0.2, "value_1": 0.1}, {"knots": KNOTS})
    assert curve.levels == [0.2, 0.1]
    assert Effect("place", "lag", "lag", {"amplitude": 1.0}, {"scale": 1.0}).levels == []  # a blend is no level


@settings(max_examples=50, deadline=None)
@given(
    drive=st.floats(-5.0, 8.0),
    values=st.lists(st.floats(-2.0, 2.0), min_size=len(KNOTS), max_size=len(KNOTS)),
)
def test_a_polyline_is_what_numpy_interpolates(drive: float, values: list[float]) -> None:
    """Against `numpy.interp`, between the knots and beyond them."""
    coefficients = {f"value_{k + 1}": v for k, v in enumerate(values)}
    drawn = output(effect(FORMS["polyline"], coefficients, "offset"), 5.0, drive, 900.0, 0.5) - 5.0
    assert drawn == pytest.approx(float(np.interp(drive, KNOTS, values)), abs=1e-9)
