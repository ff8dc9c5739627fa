"""A record with gaps: the longest stretch is read, and the reader says so."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import read_dataset
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


def test_without_the_column_a_gap_is_refused_as_ever() -> None:
    with pytest.raises(DataError, match="time is not uniform"):
        read_dataset(table(5, 9).drop(columns="stretch"), TANK)
