"""Rows that a logger has lost: they are put back empty, and a note says so; a longer hole splits the record."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import read_dataset
from adaptive_flot.greybox.data.lost_rows import MOST_LOST, with_lost_rows
from tests.abuse.records import TANK

WHOLE = pd.DataFrame({"time_s": 2.0 * np.arange(200), "inflow_m3_s": 1e-3 * np.arange(200), "level_m": 1.0})


def test_a_lost_row_is_a_row_without_a_measurement() -> None:
    """The inputs are those before it, and nothing is left out."""
    record = read_dataset(WHOLE.drop(index=[40, 90, 91]), TANK)
    assert len(record) == len(WHOLE) and np.allclose(record.time, WHOLE["time_s"])
    assert np.flatnonzero(np.isnan(record.outputs[:, 0])).tolist() == [40, 90, 91]
    assert record.inputs[[40, 90, 91], 0] == pytest.approx([0.039, 0.089, 0.089])
    assert record.notes == (
        "3 rows are missing after lines 41, 90: taken as rows without a measurement, with the inputs before",
    )


@given(st.sets(st.integers(1, 198), min_size=1, max_size=15))
@settings(max_examples=50, deadline=None)
def test_what_is_put_back_is_what_was_lost(lost: set[int]) -> None:
    """Every row that is there stays as it is, and the times are those of the whole record, or it is split as ever."""
    kept = WHOLE.drop(index=list(lost))
    full, notes = with_lost_rows(kept, "time_s", Path("r.csv"), {"level_m"})
    holes = np.diff(kept["time_s"]) / 2.0 - 1
    assert len(notes) == bool(np.any((holes > 0) & (holes <= MOST_LOST)))
    assert full["level_m"].notna().sum() == len(kept)
    assert full.loc[full["level_m"].notna()].reset_index(drop=True).equals(kept.reset_index(drop=True))
    if holes.max() <= MOST_LOST:
        assert np.allclose(full["time_s"], WHOLE["time_s"])


def test_a_longer_hole_splits_the_record() -> None:
    """Nothing says what the inputs were all that time."""
    record = read_dataset(WHOLE.drop(index=range(120, 121 + MOST_LOST)), TANK)
    assert len(record) == 120 and "2 stretches with gaps" in record.notes[0]


def test_times_that_are_uneven_are_refused_as_ever() -> None:
    """A step of one and a half intervals is no lost row."""
    late = WHOLE.copy()
    late.loc[100:, "time_s"] += 1.0
    with pytest.raises(DataError, match="time is not uniform"):
        read_dataset(late.head(110), TANK)


def test_a_record_that_misses_many_rows_is_left_as_it_is() -> None:
    """Then the sampling interval is another one, or the table was thinned."""
    thinned = WHOLE.drop(index=list(range(5, 195, 5)))
    full, notes = with_lost_rows(thinned, "time_s", Path("r.csv"), {"level_m"})
    assert full is thinned and notes == ()
