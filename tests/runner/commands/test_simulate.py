"""Simulating a table: what comes out is the stepper's run of what went in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.greybox.model import Model, Quantity, Scope
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.commands.simulate import misfit, simulate_record, start_of

ROWS = 30


@pytest.fixture
def record(model: Model) -> Dataset:
    """Half a minute with an air step and a drifting C."""
    inputs = np.tile([1.5e-3, 1.67e-4, 0.38], (ROWS, 1))
    inputs[10:, 0] = 1.7e-3
    outputs = np.full((ROWS, len(model.outputs)), np.nan)
    drift = {"coalescence_rate": 6.38e-4 * np.linspace(1.0, 1.1, ROWS)}
    return Dataset("table", np.arange(5.0, 5.0 + ROWS), 1.0, inputs, outputs, drift)


def test_it_is_the_stepper_from_the_steady_state_of_the_first_row(model: Model, record: Dataset) -> None:
    """Row 0 is the initial instant, steady at its own inputs and parameters; row 1 is the first step."""
    table = simulate_record(record, model)
    p = np.tile(model.parameter_values, (ROWS, 1))
    p[:, model.index("parameters", "C")] = record.parameters["coalescence_rate"]
    x0 = steady_state(model, record.inputs[0], p[0]).state
    run = Stepper(model, 1.0).simulate(x0, record.inputs[1:], p[1:])
    for j, q in enumerate(model.states):
        np.testing.assert_allclose(table[q.column], [x0[j], *run.states[:, j]], rtol=1e-12)
    for j, q in enumerate(model.outputs):
        np.testing.assert_allclose(table[q.column].iloc[1:], run.outputs[:, j], rtol=1e-12)
    for j, q in enumerate(model.signals):
        np.testing.assert_allclose(table[q.column].iloc[1:], run.signals[:, j], rtol=1e-12)
    np.testing.assert_array_equal(table["C"], record.parameters["coalescence_rate"])
    np.testing.assert_array_equal(table["time_s"], record.time)
    grade = table["concentrate_grade"]
    assert grade.iloc[0] == pytest.approx(grade.iloc[1], rel=1e-2) and grade.iloc[-1] != pytest.approx(grade.iloc[0])


def store(starts_steady: bool) -> Model:
    """What comes in stays: it has no steady state while anything does."""

    def equations(m: Scope) -> None:
        charge = m.state("charge")
        m.derivative("charge", m.input("current"))
        m.derivative("lost", m.input("current"))
        m.output("shown", charge)

    return Model(
        name="store",
        states=(Quantity("charge", "A s", "", 0.0, 1e3, scale=5.0), Quantity("lost", "A s", "", 0.0, 1e3, scale=3.0)),
        inputs=(Quantity("current", "A", "", 0.0, 10.0),),
        parameters=(),
        outputs=(Quantity("shown", "A s", "", 0.0, 1e3),),
        equations=equations,
        starts_steady=starts_steady,
        initial_guess={"charge": 20.0},
    )


def test_a_model_without_a_steady_state_starts_from_its_first_guess() -> None:
    """Where a guess is missing, it is the scale of the state. One that is said to start steady is refused."""
    record = Dataset("r", np.arange(4.0), 1.0, np.ones((4, 1)), np.full((4, 1), np.nan))
    table = simulate_record(record, store(False))
    np.testing.assert_allclose(table["charge_A_s"], [20.0, 21.0, 22.0, 23.0])
    np.testing.assert_allclose(table["lost_A_s"], [3.0, 4.0, 5.0, 6.0])
    with pytest.raises(RangeError, match="no steady state"):
        simulate_record(record, store(True))


def test_a_model_that_has_a_steady_state_starts_there_though_its_records_need_not(
    model: Model, record: Dataset
) -> None:
    moving = replace(model, starts_steady=False)
    np.testing.assert_array_equal(simulate_record(record, moving), simulate_record(record, model))
    assert "at the steady state" in start_of(record, moving).words


def test_a_state_starts_where_the_first_row_shows_it() -> None:
    """Also where another state has no column: that one starts at rest. A steady model starts at rest in all."""

    def equations(m: Scope) -> None:
        heat = m.state("heat")
        m.derivative("heat", m.input("power") - 0.1 * heat)
        m.derivative("hidden", heat - m.state("hidden"))
        m.output("heat", heat)

    cooling = Model(
        name="cooling",
        states=(Quantity("heat", "K", "", -1e3, 1e3), Quantity("hidden", "W", "", -1e3, 1e3)),
        inputs=(Quantity("power", "W", "", 0.0, 10.0),),
        parameters=(),
        outputs=(Quantity("heat", "K", ""),),
        equations=equations,
        starts_steady=False,
        initial_guess={"heat": 3.0, "hidden": 4.0},
    )
    record = Dataset("r", np.arange(4.0), 1.0, np.ones((4, 1)), np.array([[7.0], [np.nan], [6.0], [5.0]]))
    start = start_of(record, cooling)
    np.testing.assert_allclose(start.state, [7.0, 10.0], rtol=1e-6)
    assert start.words == "at the steady state of the first row's inputs, but with heat as measured there"
    steady = start_of(record, replace(cooling, starts_steady=True))
    np.testing.assert_allclose(steady.state, [10.0, 10.0], rtol=1e-6)
    unseen = replace(record, outputs=np.full((4, 1), np.nan))
    np.testing.assert_allclose(start_of(unseen, cooling).state, [10.0, 10.0], rtol=1e-6)


def test_what_is_measured_stands_beside_what_is_simulated(model: Model, record: Dataset) -> None:
    outputs = np.full((len(record), len(model.outputs)), np.nan)
    clean = simulate_record(record, model)
    level = model.index("outputs", "level")
    outputs[1:, level] = clean["level_m"].iloc[1:] + 0.003
    table = simulate_record(replace(record, outputs=outputs), model)
    np.testing.assert_array_equal(table["level_m"], clean["level_m"])
    np.testing.assert_array_equal(table["level_m_measured"], outputs[:, level])
    assert [c for c in map(str, table) if c.endswith("_measured")] == ["level_m_measured"]
    assert misfit(table, model) == {"level": pytest.approx(0.003)}


def test_a_steady_record_stays_where_it_is(model: Model, record: Dataset) -> None:
    constant = replace(record, inputs=np.tile(record.inputs[0], (ROWS, 1)), parameters={})
    table = simulate_record(constant, model)
    values = table.drop(columns="time_s").to_numpy(dtype=float)
    np.testing.assert_allclose(values, np.tile(values[0], (ROWS, 1)), rtol=1e-9)


def test_the_rest_of_a_simulation_can_be_simulated_from_its_table(
    model: Model, record: Dataset, tmp_path: Path
) -> None:
    """The states in the first row of a table are its initial condition, whatever its inputs are."""
    whole = simulate_record(record, model)
    write_table(whole.iloc[12:], tmp_path / "rest.parquet")
    rest = simulate_record(read_dataset(tmp_path / "rest.parquet", model), model)
    for column in whole.columns:
        np.testing.assert_allclose(rest[column], whole[column].iloc[12:], rtol=1e-9)


@pytest.mark.parametrize(
    ("state", "value", "says"),
    [("level", 0.6, "level"), ("m_valuable", -1.0, "m_valuable"), ("gas_ratio_1", 2.0, "gas_ratio_1")],
)
def test_a_state_outside_its_range_is_named_with_the_time(
    model: Model, record: Dataset, state: str, value: float, says: str
) -> None:
    x0 = steady_state(model, record.inputs[0]).state
    x0[model.index("states", state)] = value
    with pytest.raises(RangeError, match=rf"table: .*{says}.* at time 5 s") as caught:
        simulate_record(replace(record, initial_state=x0), model)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("accurate", [False, True])
@pytest.mark.parametrize(
    ("feed", "setpoint"), [(1.7e-3, 0.38), (1.67e-4, 0.001)], ids=["pulp over the lip", "froth breaks down"]
)
def test_a_run_that_leaves_the_model_is_an_error_with_the_time_it_did(
    model: Model, record: Dataset, feed: float, setpoint: float, accurate: bool
) -> None:
    """Ten times the feed, or a set-point at the bottom: the inputs are in their range, the states do not stay so."""
    inputs = np.tile([1.5e-3, feed, setpoint], (300, 1))
    inputs[:5] = [1.5e-3, 1.67e-4, 0.38]
    outputs = np.full((300, len(model.outputs)), np.nan)
    long = replace(record, time=np.arange(300.0), inputs=inputs, outputs=outputs, parameters={})
    with pytest.raises(RangeError, match=r"table: .* at time [0-9.]+ s") as caught:
        simulate_record(long, model, accurate=accurate)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0.1, 9.0])
def test_a_parameter_outside_its_range_is_named_with_the_time(model: Model, record: Dataset, value: float) -> None:
    n = np.ones(ROWS)
    n[7] = value
    with pytest.raises(RangeError, match=rf"table: parameter n = {value:g} - at time 12 s"):
        simulate_record(replace(record, parameters={"growth_exponent": n}), model)
