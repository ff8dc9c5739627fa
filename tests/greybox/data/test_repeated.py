"""Rows that were written twice are left out and end a stretch; a record that comes to rest, or is coarse, is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.data.repeated import repeated_rows
from adaptive_flot.greybox.data.stretches import every_stretch
from tests.abuse.records import TANK


def record(rows: int = 300, seed: int = 0) -> pd.DataFrame:
    """A tank whose level and inflow are noisy."""
    rng = np.random.default_rng(seed)
    level = 1.0 + 0.1 * np.sin(np.arange(rows) / 20) + 0.01 * rng.standard_normal(rows)
    inflow = np.repeat(rng.uniform(0.1, 0.2, rows // 20 + 1), 20)[:rows] + 0.001 * rng.standard_normal(rows)
    return pd.DataFrame({"time_s": 2.0 * np.arange(rows), "inflow_m3_s": inflow, "level_m": level})


@settings(max_examples=10)
@given(st.integers(1, 250), st.integers(10, 45), st.integers(0, 99))
def test_held_rows_are_found_wherever_they_are(start: int, count: int, seed: int) -> None:
    table = record(seed=seed)
    table.loc[start : start + count - 1, ["inflow_m3_s", "level_m"]] = table.loc[
        start - 1, ["inflow_m3_s", "level_m"]
    ].to_numpy()
    assert np.flatnonzero(repeated_rows(table, "time_s")).tolist() == list(range(start, min(start + count, 300)))


def test_a_part_that_was_pasted_twice_is_found_the_second_time() -> None:
    table = record()
    table.loc[150:199, ["inflow_m3_s", "level_m"]] = table.loc[20:69, ["inflow_m3_s", "level_m"]].to_numpy()
    assert np.flatnonzero(repeated_rows(table, "time_s")).tolist() == list(range(150, 200))


def test_a_clean_a_coarse_and_a_noise_free_record_are_kept() -> None:
    table = record()
    smooth = table.assign(level_m=1.0 - np.exp(-np.arange(300) / 3.0))  # at rest to the last bit after a third
    coarse = table.assign(level_m=table["level_m"].round(2))
    for kept in (table, smooth, coarse):
        assert not repeated_rows(kept, "time_s").any()


def test_one_sensor_that_stops_is_no_repeated_row() -> None:
    table = record()
    table["inflow_m3_s"] = np.repeat(np.linspace(0.1, 0.2, 15), 20)
    table["level_m"] = table["level_m"].where(~table.index.isin(range(100, 120)), table["level_m"][99])
    assert not repeated_rows(table, "time_s").any()


def test_a_hole_in_the_measurements_repeats_nothing() -> None:
    """Rows without any measurement, while the inputs rest: the inputs are known, so the record goes on."""
    table = record()
    table["inflow_m3_s"] = np.repeat([0.1, 0.2, 0.15], 100)
    table["outflow_m3_s"] = table["level_m"] ** 0.5
    whole = table.copy()
    table.loc[110:169, ["level_m", "outflow_m3_s"]] = np.nan
    assert not repeated_rows(table, "time_s").any()
    held = ["level_m", "outflow_m3_s"]
    whole.loc[110:169, held] = whole.loc[109, held].to_numpy()  # the same rows, held instead of empty
    assert repeated_rows(whole, "time_s").sum() == 60


def test_the_record_is_split_there_and_the_note_names_the_lines() -> None:
    table = record()
    table.loc[100:119, ["inflow_m3_s", "level_m"]] = table.loc[99, ["inflow_m3_s", "level_m"]].to_numpy()
    read = read_dataset(table, TANK)
    assert len(read) == 180 and read.time[0] == 240.0
    assert "lines 102 to 121 repeat earlier rows" in read.notes[0] and "stretch 2 is used" in read.notes[1]
    assert [len(part) for part in every_stretch(table, "time_s", Path("r.csv"))] == [100, 180]


@pytest.mark.parametrize("back", [30.0, 100.0])
def test_a_clock_that_jumps_back_splits_the_record(back: float) -> None:
    table = record()
    table["time_s"] -= np.where(np.arange(300) >= 120, back, 0.0)
    read = read_dataset(table, TANK)
    assert len(read) == 180 and "the clock jumps back in line 122" in read.notes[0]


def test_a_pasted_part_is_no_stretch_of_those_that_are_counted() -> None:
    """Two are left, and the longest is the second: it was called the third."""
    table = record()
    pasted = pd.concat([table[:120], table[50:100], table[120:]], ignore_index=True)
    read = read_dataset(pasted, TANK)
    assert len(read) == 180
    assert "the record has 2 stretches with gaps between them: stretch 2 is used" in read.notes[-1]
