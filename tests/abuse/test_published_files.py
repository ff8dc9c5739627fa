"""Damaged files of the published forms (iron columns, zinc cell, cascaded tanks): one line of error each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.processes import zinc_level
from tests.abuse.records import HOURS, PUBLISHED, refusal


@pytest.mark.parametrize("process", PUBLISHED)
def test_sound_file_of_the_published_form_is_read(tmp_path: Path, process: str) -> None:
    """What the next test changes is the only thing wrong with its tables."""
    read, table = PUBLISHED[process]
    table.to_csv(tmp_path / "record.csv", index=False)
    read(tmp_path / "record.csv")


@pytest.mark.parametrize(
    ("process", "column", "values", "part"),
    [
        ("iron", "hour", HOURS.tz_localize("UTC").astype(str), "line 2: '2017-04-11 10:00:00+00:00' has a time"),
        ("iron", "hour", ["noon"] * 4, "'hour', line 2: 'noon' is no date"),
        ("iron", "hour", ["noon", *HOURS.astype(str)[1:]], "'hour', line 2: 'noon' is no date"),
        ("iron", "hour", [1, 2, 3, 4], "'hour', line 2: '1' is no date"),
        ("iron", "hour", HOURS[::-1].astype(str), "not one row an hour"),
        ("iron", "pulp_ph", [9.8, np.nan, 9.8, 9.8], "input 'ph' has no value in line 3"),
        ("iron", "air_01", [np.inf] * 4, "'air_01', line 2: inf is no measured value"),
        ("iron", "silica_conc_pct", [-np.inf] * 4, "-inf is no measured value"),
        ("iron", "pulp_ph", 140.0, "ph = 140"),
        ("zinc", zinc_level.TIME, ["01/02/2020 00:00:00"] * 4, "does not increase"),
        ("zinc", zinc_level.TIME, ["yesterday"] * 4, "'yesterday'"),
        ("zinc", zinc_level.COLUMNS["ph"], [8, np.nan, 8, 8], "input 'ph' has no value in line 3"),
        ("zinc", zinc_level.COLUMNS["ph"], 80.0, "ph = 80"),
        ("zinc", zinc_level.COLUMNS["level"], [True] * 4, "holds true and false"),
        ("tanks", "Ts", 0.0, "Ts = 0"),
        ("tanks", "Ts", 1e9, "steps of model"),
        ("tanks", "uEst", [1.0, np.nan, 1.0, 1.0], "empty cell"),
        ("tanks", "uVal", 1e9, "pump_voltage = 1e+09"),
        ("tanks", "yEst", "high", "'high' is not a number"),
    ],
)  # fmt: skip
def test_fault_in_a_published_file_is_refused(
    tmp_path: Path, process: str, column: str, values: Any, part: str
) -> None:
    read, table = PUBLISHED[process]
    file = tmp_path / "record.csv"
    table.assign(**{column: values}).to_csv(file, index=False)
    assert part in refusal(lambda: read(file), file)


@pytest.mark.parametrize("process", PUBLISHED)
@pytest.mark.parametrize("rows", [0, 1])
def test_published_file_without_rows_to_speak_of_is_refused(tmp_path: Path, process: str, rows: int) -> None:
    read, table = PUBLISHED[process]
    file = tmp_path / "record.csv"
    table[:rows].to_csv(file, index=False)
    refusal(lambda: read(file), file)
