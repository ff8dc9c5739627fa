"""`adaptive-flot simulate`: tables in, tables out, in the columns that the data have."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from tests.cli.conftest import Call, WriteTable
from tests.runner.records import PlantRecord

# shared/model/README.md, "Data columns"
COLUMNS = """time_s air_flow_m3_s feed_flow_m3_s level_setpoint_m level_m tails_flow_m3_s concentrate_grade air_recovery
concentrate_flow_m3_s recovery n C alpha_star interfacial_gas_velocity_m_s interface_bubble_size_m froth_bubble_size_m
m_valuable_kg m_gangue_kg gas_ratio_1 gas_ratio_2 gas_ratio_3 gas_ratio_4 gas_ratio_5""".split()
STATES = ["tails_flow_m3_s", "level_m", "m_valuable_kg", "m_gangue_kg", *(f"gas_ratio_{k}" for k in range(1, 6))]
INPUTS = ["time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m"]


@pytest.fixture
def truth(plant: PlantRecord, tmp_path: Path) -> pd.DataFrame:
    """A simulation written as `truth.csv`, with the parameters that made it."""
    table = plant.truth.assign(n=1.04, C=6.7e-4)
    table.to_csv(tmp_path / "truth.csv", index=False)
    return table


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_simulated_table_comes_back(call: Call, truth: pd.DataFrame, tmp_path: Path, suffix: str) -> None:
    result = call("simulate", "truth.csv", "--out", f"new/again{suffix}")
    assert result.code == 0, result.err
    assert "150 rows" in result.out
    read: Callable[[Path], pd.DataFrame] = pd.read_csv if suffix == ".csv" else pd.read_parquet
    again = read(tmp_path / "new" / f"again{suffix}")
    measured = {"level_m", "tails_flow_m3_s", "concentrate_grade", "air_recovery", "concentrate_flow_m3_s", "recovery"}
    assert set(again.columns) == set(truth.columns) | {f"{column}_measured" for column in measured}
    words = " ".join(result.out.split())
    assert "starts with the states in the first row" in words and "root mean square" in words
    for column in truth.columns:
        np.testing.assert_allclose(again[column], truth[column], rtol=1e-9, err_msg=column)


def test_columns_are_named_as_the_data_are(call: Call, truth: pd.DataFrame, tmp_path: Path) -> None:
    call("simulate", "truth.csv", "--out", "again.csv")
    assert set(COLUMNS) <= set(pd.read_csv(tmp_path / "again.csv").columns)


def test_states_in_the_first_row_are_the_initial_condition(call: Call, truth: pd.DataFrame, tmp_path: Path) -> None:
    """From the middle of a transient on, with the states only in the first row."""
    rest = truth.iloc[60:].reset_index(drop=True)[[*INPUTS, "n", "C", *STATES]]
    rest.loc[1:, STATES] = np.nan
    rest.to_csv(tmp_path / "rest.csv", index=False)
    call("simulate", "rest.csv", "--out", "again.csv")
    again = pd.read_csv(tmp_path / "again.csv")
    np.testing.assert_allclose(again["concentrate_grade"], truth["concentrate_grade"].iloc[60:], rtol=1e-9)


@pytest.mark.parametrize("dropped", [STATES, STATES[:1]], ids=["no states", "one state missing"])
def test_without_all_states_it_starts_steady(
    call: Call, truth: pd.DataFrame, tmp_path: Path, model: Model, dropped: list[str]
) -> None:
    truth.iloc[60:].drop(columns=dropped).to_csv(tmp_path / "rest.csv", index=False)
    call("simulate", "rest.csv", "--out", "again.csv")
    again = pd.read_csv(tmp_path / "again.csv")
    inputs = truth[INPUTS[1:]].iloc[60].to_numpy(dtype=float)
    fitted = model.with_parameters({"n": 1.04, "C": 6.7e-4})
    np.testing.assert_allclose(again[STATES].iloc[0], steady_state(fitted, inputs).state, rtol=1e-8)


def test_accurate_and_fast_agree_to_a_ten_thousandth(call: Call, truth: pd.DataFrame, tmp_path: Path) -> None:
    call("simulate", "truth.csv", "--out", "fast.csv")
    assert call("simulate", "truth.csv", "--out", "accurate.csv", "--accurate").code == 0
    fast, accurate = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("fast", "accurate"))
    worst = ((fast - accurate).abs().max() / accurate.abs().max()).max()
    assert 0 < worst < 1e-4


@pytest.mark.parametrize(("options", "limit"), [([], 1e-4), (["--accurate"], 1e-6)])
def test_the_reference_trajectory_is_reproduced(
    call: Call, shared_file: Callable[[str], Path], tmp_path: Path, options: list[str], limit: float
) -> None:
    """The first two minutes of the steps in air, level and feed, from the file of the independent implementation."""
    reference = pd.read_csv(shared_file("reference/steps.csv")).iloc[:120]
    reference.to_csv(tmp_path / "steps.csv", index=False)
    result = call("simulate", "steps.csv", "--out", "found.csv", *options)
    assert result.code == 0, result.err
    found = pd.read_csv(tmp_path / "found.csv")
    for column in reference.columns:
        worst = float((found[column] - reference[column]).abs().max() / reference[column].abs().max())
        assert worst < limit, column


def test_another_cell_gives_another_simulation(
    call: Call, truth: pd.DataFrame, tmp_path: Path, write_cell: Callable[..., Path]
) -> None:
    cell = write_cell({"minerals.floatability": {"value": [3.5e-4, 3.0e-6], "unit": "-", "source": "test"}})
    call("simulate", "truth.csv", "--out", "plain.csv", "--cell", "lab_87l")
    call("simulate", "truth.csv", "--out", "better.csv", "--cell", cell)
    plain, better = (pd.read_csv(tmp_path / f"{n}.csv")["recovery"].iloc[-1] for n in ("plain", "better"))
    assert better > 1.02 * plain


def test_a_cell_given_as_model_is_told_where_it_goes(call: Call, table: WriteTable, tmp_path: Path) -> None:
    """From Python a model may be named by its cell; in the shell cells have an option of their own."""
    table()
    result = call("simulate", "record.csv", "--model", "lab_87l", "--out", "out.csv")
    assert result.code == 2 and result.err.count("\n") == 1 and "give it by --cell lab_87l" in result.err
    assert not (tmp_path / "out.csv").exists()
