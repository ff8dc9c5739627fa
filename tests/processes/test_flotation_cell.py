"""The cell's physics: conservation, reduction to a simpler cell, the sign of the level loop."""

from collections.abc import Callable, Mapping
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.flotation import make_model, read_cell
from adaptive_flot.processes.flotation.level_loop import loop_poles

WriteCell = Callable[[Mapping[str, object]], Path]
CELLS: dict[str, dict[str, object]] = {
    "laboratory cell": {},
    "three minerals": {
        "minerals.names": ["chalcopyrite", "pyrite", "quartz"],
        "minerals.floatability.value": [2.8e-4, 5e-5, 3e-6],
        "minerals.particle_diameter.value": [7.5e-5, 7e-5, 7.3e-5],
        "minerals.density.value": [4200.0, 5000.0, 2650.0],
        "minerals.feed_concentration.value": [10.6, 40.0, 479.4],
    },
    "two bubble classes": {"bubbles.diameter.value": [4e-4, 9e-4], "bubbles.number.value": [3000, 1000]},
    "one bubble class": {"bubbles.diameter.value": [6e-4], "bubbles.number.value": [1]},
}
NOMINAL = np.array([1.5e-3, 1.67e-4, 0.38])
operating_point = st.tuples(st.floats(9.05e-4, 2.17e-3), st.floats(1e-4, 3e-4), st.floats(0.345, 0.42)).map(np.array)
Named = dict[str, float]


@pytest.fixture(scope="module", params=CELLS)
def cell(request: pytest.FixtureRequest, write_cell: WriteCell) -> Model:
    return make_model(read_cell(write_cell(CELLS[request.param])))


def evaluate(model: Model, x: FloatArray, u: FloatArray) -> tuple[Named, Named, Named]:
    """Rates, outputs and signals by name."""
    rates, y, s, _ = FastCall(model.ode)(0.0, x, u, model.parameter_values)
    return (
        dict(zip(model.names("states"), rates, strict=True)),
        dict(zip(model.names("outputs"), y, strict=True)),
        dict(zip(model.names("signals"), s, strict=True)),
    )


def parameter(model: Model, name: str) -> float:
    return float(model.parameter_values[model.index("parameters", name)])


def feed_concentrations(model: Model) -> FloatArray:
    names = model.expand_parameters(["feed_concentration"])
    return model.parameter_values[model.indices("parameters", names)]


# -- conservation ------------------------------------------------------------------------------------------------------


@given(u=operating_point)
def test_steady_state_conserves_minerals_air_and_volume(cell: Model, u: FloatArray) -> None:
    """Fed = tails + concentrate for the valuable mineral and for all of them; air in = air out; level = set-point."""
    air, feed, setpoint = u
    x = steady_state(cell, u).state
    _, y, s = evaluate(cell, x, u)
    area, fed = parameter(cell, "A"), feed_concentrations(cell) * feed
    masses = x[2 : 2 + len(fed)]
    tails = masses / (area * y["level"]) * y["tails_flow"]
    valuable = y["recovery"] * fed[0]
    assert valuable + tails[0] == pytest.approx(fed[0], rel=1e-8)
    assert valuable / y["concentrate_grade"] + tails.sum() == pytest.approx(fed.sum(), rel=1e-8)
    assert s["interfacial_gas_velocity"] * area == pytest.approx(air, rel=1e-8)
    assert y["level"] == pytest.approx(setpoint, rel=1e-8)
    assert y["tails_flow"] + y["concentrate_flow"] == pytest.approx(feed, rel=1e-8)
    assert y["air_recovery"] == pytest.approx(s["alpha_star"], rel=1e-8)
    assert 0 < y["recovery"] < 1
    assert 0 < y["concentrate_grade"] < 1


@given(u=operating_point, move=arrays(float, 10, elements=st.floats(-0.03, 0.03)))
def test_balances_hold_away_from_steady_state(cell: Model, u: FloatArray, move: FloatArray) -> None:
    """Gas-free pulp height h_0 = (1 - sum eps) h_p changes by the net liquid flow only; minerals balance."""
    n_minerals = len(feed_concentrations(cell))
    x = steady_state(cell, u).state
    x = x * (1 + move[: x.size])
    rates, y, _ = evaluate(cell, x, u)
    dx = np.array([rates[name] for name in cell.names("states")])
    area, feed = parameter(cell, "A"), u[1]

    def gas_free(state: FloatArray) -> float:
        ratios = state[2 + n_minerals :]
        return float((1 - np.sum(ratios / (1 + ratios.sum()))) * state[1])

    assert gas_free(x) == pytest.approx(x[1] / (1 + x[2 + n_minerals :].sum()), rel=1e-12)
    h = 1e-2  # the rates are small: this moves the level by micrometres
    change = (gas_free(x + h * dx) - gas_free(x - h * dx)) / (2 * h)
    assert change * area == pytest.approx(feed - y["tails_flow"] - y["concentrate_flow"], rel=1e-4, abs=1e-11)

    fed = feed_concentrations(cell) * feed
    tails = x[2 : 2 + n_minerals] / (area * y["level"]) * y["tails_flow"]
    valuable = y["recovery"] * fed[0]
    assert dx[2] == pytest.approx(fed[0] - tails[0] - valuable, rel=1e-8, abs=1e-12)
    total = fed.sum() - tails.sum() - valuable / y["concentrate_grade"]
    assert dx[2 : 2 + n_minerals].sum() == pytest.approx(total, rel=1e-8, abs=1e-10)


def test_level_loop_brings_the_level_to_its_set_point(model: Model, fast: Stepper) -> None:
    """After a step of 2 cm: more tails flow lowers the level, and the loop does not stop short of the set-point."""
    x = steady_state(model, NOMINAL).state
    run = fast.simulate(x, np.tile([1.5e-3, 1.67e-4, 0.36], (3000, 1)))
    level = run.states[:, 1]
    assert run.states[5, 0] > x[0]
    assert abs(level[-1] - 0.36) < 1e-5
    assert level.min() > 0.355


# -- reduction to a simpler cell ---------------------------------------------------------------------------------------


def split(valuable: bool) -> dict[str, object]:
    """The laboratory cell with its valuable or its gangue mineral cut into two equal halves."""
    pick = [0, 0, 1] if valuable else [0, 1, 1]
    share = np.array([0.5, 0.5, 1.0] if valuable else [1.0, 0.5, 0.5])

    def values(*both: float) -> list[float]:
        return [both[i] for i in pick]

    return {
        "minerals.names": ["one", "two", "three"],
        "minerals.floatability.value": values(2.8e-4, 3e-6),
        "minerals.particle_diameter.value": values(7.5e-5, 7.3e-5),
        "minerals.density.value": values(4200.0, 2650.0),
        "minerals.feed_concentration.value": (share * values(10.6, 519.4)).tolist(),
    }


@pytest.mark.parametrize("valuable", [True, False], ids=["valuable", "gangue"])
def test_splitting_a_mineral_into_halves_changes_nothing(model: Model, write_cell: WriteCell, valuable: bool) -> None:
    """Same recovery, level and flows over a transient; the grade of one half of the valuable mineral is half."""
    halves = make_model(read_cell(write_cell(split(valuable))))
    u = np.repeat([[2.0e-3, 1.67e-4, 0.40], [1.2e-3, 1.4e-4, 0.36]], 60, axis=0)
    whole_run, run = (Stepper(m, 1.0).simulate(steady_state(m, NOMINAL).state, u).outputs for m in (model, halves))
    expected = whole_run.copy()
    expected[:, model.index("outputs", "concentrate_grade")] *= 0.5 if valuable else 1.0
    np.testing.assert_allclose(run, expected, rtol=1e-9)


def test_bubble_classes_of_equal_size_are_one_class_at_steady_state(write_cell: WriteCell) -> None:
    """Grade, recovery and flows depend on the bubbles through d_int only, the mean of equals.

    Their holdup differs, as it should: each class is crowded by itself only, (1 - eps_k)^-1.39.
    """
    five = make_model(read_cell(write_cell({"bubbles.diameter.value": [6e-4] * 5})))
    one = make_model(read_cell(write_cell(CELLS["one bubble class"])))
    for u in ([9.5e-4, 1.67e-4, 0.38], [2.1e-3, 1.5e-4, 0.36]):
        outputs = [evaluate(m, steady_state(m, np.array(u)).state, np.array(u))[1] for m in (five, one)]
        assert outputs[0] == pytest.approx(outputs[1], rel=1e-9)


def test_bubble_classes_without_bubbles_do_not_matter(write_cell: WriteCell) -> None:
    """Four empty classes beside the one that gets all the air: the cell with that class alone, transients included."""
    sizes = [2e-4, 4e-4, 6e-4, 8e-4, 1e-3]
    padded = make_model(
        read_cell(write_cell({"bubbles.diameter.value": sizes, "bubbles.number.value": [0, 0, 1, 0, 0]}))
    )
    alone = make_model(read_cell(write_cell(CELLS["one bubble class"])))
    x = steady_state(alone, NOMINAL).state
    u = np.repeat([[2.0e-3, 1.67e-4, 0.40], [1.2e-3, 1.4e-4, 0.36]], 30, axis=0)
    expected = Stepper(alone, 1.0).simulate(x, u)
    run = Stepper(padded, 1.0).simulate(np.array([*x[:4], 0, 0, x[4], 0, 0]), u)
    np.testing.assert_allclose(run.outputs, expected.outputs, rtol=1e-10)
    np.testing.assert_allclose(run.states[:, 6], expected.states[:, 4], rtol=1e-10)
    np.testing.assert_array_equal(run.states[:, [4, 5, 7, 8]], 0)


# -- the level loop ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("air", [9.5e-4, 1.5e-3, 2.1e-3])
@pytest.mark.parametrize("level", [0.345, 0.38, 0.42])
def test_level_loop_is_stable_with_our_sign_and_not_with_the_printed_one(
    model: Model, air: float, level: float
) -> None:
    """Eigenvalues of the whole cell, linearised; the printed minus turns the sign of the integral action only."""
    u, p = np.array([air, 1.67e-4, level]), model.parameter_values
    t, x, inputs, parameters = model.ode.sx_in()
    rates = model.ode(t, x, inputs, parameters)[0]
    slope = FastCall(ca.Function("slope", [t, x, inputs, parameters], [ca.jacobian(rates, x)]))
    a = slope(0.0, steady_state(model, u).state, u, p)[0]
    proportional = parameter(model, "k_p") * a[1]
    integral = np.eye(9)[1] * parameter(model, "k_p") / parameter(model, "tau_i")
    np.testing.assert_allclose(a[0], proportional + integral, rtol=1e-10, atol=1e-15)

    printed = a.copy()
    printed[0] = proportional - integral
    for matrix, sign, stable in ((a, False, True), (printed, True, False)):
        poles = np.linalg.eigvals(matrix)
        assert bool(poles.real.max() < 0) is stable
        analysed = loop_poles(model, u, printed_sign=sign)
        np.testing.assert_allclose(np.sort_complex(analysed), np.sort_complex(poles), rtol=1e-6)


# -- names -------------------------------------------------------------------------------------------------------------


def test_names_of_the_vectors(cell: Model, model: Model) -> None:
    """Two minerals are valuable and gangue, more keep their own names; one gas ratio for each bubble class."""
    assert model.names("states")[:5] == ("tails_flow", "level", "m_valuable", "m_gangue", "gas_ratio_1")
    minerals = [n.removeprefix("feed_concentration.") for n in cell.expand_parameters(["feed_concentration"])]
    masses = ["m_valuable", "m_gangue"] if len(minerals) == 2 else [f"m_{m}" for m in minerals]
    classes = len(cell.expand_parameters(["bubble_diameter"]))
    ratios = [f"gas_ratio_{k + 1}" for k in range(classes)]
    assert cell.names("states") == ("tails_flow", "level", *masses, *ratios)
    assert cell.names("inputs") == ("air_flow", "feed_flow", "level_setpoint")


def test_every_site_of_the_specification_is_there(model: Model) -> None:
    """The table of sites in the shared model description; effects attach to these names."""
    assert {s.name for s in model.sites} == {
        "air_flow", "feed_flow", "feed_grade", "bubble_size", "gas_slip", "burst_rate", "coalescence",
        "growth_exponent", "froth_recovery", "entrainment", "settling", "floatability_valuable",
        "floatability_gangue", "concentrate_flow", "tails_valve", "grade_sensor", "level_sensor", "tails_sensor",
        "air_recovery_sensor", "concentrate_flow_sensor",
    }  # fmt: skip
