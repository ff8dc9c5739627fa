"""A record with gaps: the longest stretch is read, and the reader says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.data.stretches import every_stretch
from tests.abuse.records import TANK


def table(*lengths: int) -> pd.DataFrame:
    """Stretches of these lengths, 100 s between them."""
    number = np.repeat(np.arange(len(lengths)) + 1, lengths)
    time = 2.0 * np.arange(len(number)) + 100.0 * number
    return pd.DataFrame({"time_s": time, "inflow_m3_s": 0.1, "level_m": 1.0 * number, "stretch": number})


def test_the_longest_stretch_is_read_and_a_note_says_what_is_left_out() -> None:
    record = read_dataset(table(5, 9, 4), TANK)
    assert len(record) == 9 and set(record.outputs[:, 0]) == {2.0}
    assert record.notes == (
        "the record has 3 stretches with gaps between them: stretch 2 is used, the longest, with 9 of 18 rows",
    )


def test_one_stretch_is_a_record_as_any_other() -> None:
    record = read_dataset(table(7), TANK)
    assert len(record) == 7 and record.notes == ()


def test_a_hole_in_the_time_splits_a_record_without_the_column_too() -> None:
    record = read_dataset(table(60, 90, 70).drop(columns="stretch"), TANK)
    assert len(record) == 90 and set(record.outputs[:, 0]) == {2.0}
    assert "stretch 2 is used, the longest, with 90 of 220 rows" in record.notes[0]


@pytest.mark.parametrize("lengths", [(5, 9), (20,) * 5])
def test_a_record_of_crumbs_is_refused_as_ever(lengths: tuple[int, ...]) -> None:
    """No stretch is long enough for a run: the reader says where the time jumps."""
    with pytest.raises(DataError, match="time is not uniform"):
        read_dataset(table(*lengths).drop(columns="stretch"), TANK)


def test_times_that_are_uneven_elsewhere_are_refused_as_ever() -> None:
    """A hole beside uneven steps: no rule says which rows belong together."""
    uneven = table(80, 80).drop(columns="stretch")
    uneven["time_s"] += np.where(np.arange(160) == 20, 0.3, 0.0)
    with pytest.raises(DataError, match="time is not uniform"):
        read_dataset(uneven, TANK)


@given(st.lists(st.integers(60, 90), min_size=1, max_size=5))
@settings(max_examples=20, deadline=None)
def test_every_stretch_holds_the_rows_between_two_holes(lengths: list[int]) -> None:
    """Together they are the record, each in one piece."""
    parts = every_stretch(table(*lengths).drop(columns="stretch"), "time_s", Path("r.csv"))
    assert [len(p) for p in parts] == lengths
    assert all(np.ptp(np.diff(p["time_s"])) == 0 for p in parts)
