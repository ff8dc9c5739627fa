"""Cascaded tanks: reader, mass balance, steady state, and the base fit of the public benchmark."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.metrics import rmse
from adaptive_flot.processes.cascaded_tanks import make_model, read_benchmark
from adaptive_flot.processes.registry import read_measurements
from estimators.pem import Pem

CONSTANTS = ("upper_outflow", "lower_inflow", "lower_outflow", "pump_gain")
HEADER = '"uEst","uVal","yEst","yVal","Ts",'
rate = st.floats(0.02, 0.1)


@pytest.fixture(scope="module")
def tanks() -> Model:
    return make_model()


@given(k1=rate, k2=rate, k3=rate, k4=rate, u=st.floats(0.5, 6.0))
def test_steady_state_is_that_of_torricelli(tanks: Model, k1: float, k2: float, k3: float, k4: float, u: float) -> None:
    """x1 = (k4 u / k1)^2 and x2 = (k2 k4 u / (k1 k3))^2; at these levels the rates vanish."""
    p = np.array([k1, k2, k3, k4])
    upper = (k4 * u / k1) ** 2
    levels = np.array([upper, (k2 / k3) ** 2 * upper])
    rates = FastCall(tanks.ode)(0.0, levels, [u], p)[0]  # type: ignore[arg-type]
    np.testing.assert_allclose(rates, 0, atol=1e-12)
    if levels.max() < 20:
        np.testing.assert_allclose(steady_state(tanks, np.array([u]), p, levels * 1.2).state, levels, rtol=1e-8)


def test_levels_settle_at_the_steady_state(tanks: Model) -> None:
    """Constants in the order k1, k2, k3, k4: a free run ends at (k4 u / k1)^2 from above and below."""
    p, u = np.array([0.05, 0.04, 0.06, 0.03]), 3.0
    levels = np.array([(0.03 * u / 0.05) ** 2, (0.04 / 0.06 * 0.03 * u / 0.05) ** 2])
    for x0 in ([8.0, 0.5], [0.5, 8.0]):
        run = Stepper(tanks, 4.0).simulate(np.array(x0), np.full((500, 1), u), p)
        np.testing.assert_allclose(run.states[-1], levels, rtol=1e-6)
        np.testing.assert_array_equal(run.outputs[:, 0], run.states[:, 1])


@given(upper=st.floats(0.1, 10), lower=st.floats(0.1, 10), u=st.floats(0, 6), k1=rate, k3=rate, k4=rate)
def test_water_is_conserved(
    tanks: Model, upper: float, lower: float, u: float, k1: float, k3: float, k4: float
) -> None:
    """With tanks of equal area (k2 = k1): what is pumped in less what runs out of the lower tank is what both gain."""
    rates = FastCall(tanks.ode)(0.0, [upper, lower], [u], [k1, k1, k3, k4])[0]  # type: ignore[arg-type]
    assert rates.sum() == pytest.approx(k4 * u - k3 * lower**0.5, abs=1e-14)


def test_empty_tank_stays_finite(tanks: Model) -> None:
    """The square root and its slope at and below level 0."""
    stepper = Stepper(tanks, 4.0)
    u, p = np.zeros((20, 1)), tanks.parameter_values
    found = stepper.simulate_sensitivities(np.array([0.01, 0.01]), u, p, CONSTANTS, np.zeros((2, 4)))
    assert np.isfinite(found.outputs).all()
    assert np.isfinite(found.gradient).all()


# -- the benchmark file ------------------------------------------------------------------------------------------------


def test_inputs_move_down_by_a_row(tmp_path: Path) -> None:
    """The file holds an input after its sample, a record before its row; the first row's is never used."""
    file = tmp_path / "tanks.csv"
    file.write_text(f"{HEADER}\n1,4,5,20,4,\n2,8,6,24,,\n3,12,7,28,,\n\n")
    estimation, validation = read_benchmark(file)
    for record, factor in ((estimation, 1), (validation, 4)):
        np.testing.assert_array_equal(record.time, [0, 4, 8])
        np.testing.assert_array_equal(record.inputs[1:, 0], factor * np.array([1, 2]))
        np.testing.assert_array_equal(record.outputs[:, 0], factor * np.array([5, 6, 7]))
        assert record.dt == 4.0
        assert np.isfinite(record.inputs).all()
    assert (estimation.name, validation.name) == ("tanks:Est", "tanks:Val")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (('"uEst","uVal","yEst","yVal"', "1,1,5,5", "1,1,5,5"), "column 'Ts' is missing; the cascaded-tanks file has"),
        ((HEADER, "1,1,5,5,,", "1,1,5,5,,"), "Ts = nan in its first row; give the sampling interval"),
        ((HEADER, "1,1,5,5,0,", "1,1,5,5,,"), "Ts = 0.0 in its first row; give the sampling interval"),
        ((HEADER, "1,1,5,5,4,", "1,,5,5,,"), "column 'uVal' has an empty cell; inputs can not be missing"),
        ((HEADER, "1,1,5,5,4,", "1,1,five,5,,"), "column 'yEst', line 3: 'five' is not a number; correct it"),
    ],
)
def test_fault_in_the_file_is_named(tmp_path: Path, lines: tuple[str, ...], message: str) -> None:
    file = tmp_path / "tanks.csv"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError) as error:
        read_benchmark(file)
    assert str(error.value).startswith(f"{file}: {message}")


def test_base_fit_of_the_benchmark(tanks: Model, shared_file: Callable[[str], Path]) -> None:
    """Free run of the model without overflow: 0.603 V on the record it is fitted to, 0.669 V on the other.

    The initial state is estimated on the first record and used for both, as the benchmark allows.
    """
    estimation, validation = read_benchmark(shared_file("data/cascaded-tanks/dataBenchmark.csv"))
    fitted = Pem(Setup(tanks, 4.0, CONSTANTS, ("level",)), initial_state="estimated").fit(estimation)
    assert fitted.status is Status.OK
    simulator = RecordSimulator(tanks, 4.0)
    for record, expected in ((estimation, 0.603), (validation, 0.669)):
        outputs = simulator.outputs(record, fitted.initial_state, fitted.parameters)
        assert rmse(outputs - record.outputs) == pytest.approx(expected, abs=1e-3)


def test_records_are_the_published_file_or_a_table_with_the_models_columns(tmp_path: Path) -> None:
    """Two records from the published file; one from a table that anybody may write."""
    published = pd.DataFrame(
        {"uEst": [1.0, 2.0], "uVal": [3.0, 4.0], "yEst": [5.0, 6.0], "yVal": [7.0, 8.0], "Ts": 4.0}
    )
    measured = read_measurements(published, make_model())
    assert measured.record.outputs[:, 0].tolist() == [5.0, 6.0]
    assert measured.validation is not None and measured.validation.outputs[:, 0].tolist() == [7.0, 8.0]
    own = pd.DataFrame({"time_s": [0.0, 4.0, 8.0], "pump_voltage_V": 2.0, "level_V": [5.0, 6.0, 7.0]})
    own.to_csv(tmp_path / "own.csv", index=False)
    measured = read_measurements(tmp_path / "own.csv", make_model())
    assert measured.record.outputs[:, 0].tolist() == [5.0, 6.0, 7.0] and measured.validation is None
