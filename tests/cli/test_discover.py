"""`adaptive-flot discover`: what it writes, and what it says of records and names that it can not use."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.cli.conftest import Call, WriteTable

KEYS = {"verdict", "effects", "class", "error", "tests", "parameters", "drift", "absorbed", "notes", "seconds"}


def test_a_record_that_says_too_little_gets_a_verdict_a_report_and_no_model(
    call: Call, table: WriteTable, tmp_path: Path
) -> None:
    """150 rows: `insufficient`, with the reason, exit code 0."""
    result = call("discover", table(), "--json", "copy.json", "--out", "r", "--save-model", "m.yaml")
    assert result.code == 0, result.err
    assert result.out.startswith("insufficient: ") and "usable samples" in result.out
    text = (tmp_path / "r" / "verdict.json").read_text()
    assert text == (tmp_path / "copy.json").read_text()
    verdict = json.loads(text, parse_constant=lambda word: pytest.fail(word))
    assert verdict["verdict"] == "insufficient" and KEYS <= set(verdict) and verdict["effects"] == []
    page = (tmp_path / "r" / "report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html") and "usable samples" in page
    assert not (tmp_path / "m.yaml").exists() and "nothing was fitted" in result.out


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--model", "flottation"], "flotation"),
        (["--cell", "nowhere.yaml"], "nowhere.yaml"),
        (["--save-model", "model.json"], ".yaml"),
        (["--processes", "0"], "--processes"),
        (["--model", "cascaded-tanks"], "uEst"),
    ],
)
def test_a_mistake_is_told_before_the_search_and_writes_nothing(
    call: Call, table: WriteTable, tmp_path: Path, more: list[str], says: str
) -> None:
    result = call("discover", table(), *more)
    assert result.code == 2 and says in result.err and result.out == "" and "Traceback" not in result.err
    assert {f.name for f in tmp_path.rglob("*") if f.is_file()} == {"record.csv"}


@pytest.mark.parametrize(
    ("column", "value", "says"),
    [("air_flow_m3_s", "", "air_flow_m3_s"), ("feed_flow_m3_s", "much", "feed_flow_m3_s"), ("time_s", 7.5, "increase")],
)
def test_a_record_that_can_not_be_read_is_one_line(
    call: Call, table: WriteTable, column: str, value: float | str, says: str
) -> None:
    def change(t: pd.DataFrame) -> pd.DataFrame:
        t[column] = t[column].astype(object)
        t.loc[20, column] = value
        return t

    result = call("discover", table(change))
    assert result.code == 2 and says in result.err and "record.csv" in result.err
    assert len(result.err.splitlines()) == 1


@pytest.mark.parametrize("limit", ["air_flow", "air_flow=1:", "air_flow=0.002:0.001", "air_flw=0.001:0.002"])
def test_a_limit_that_can_not_be_read_is_one_line(call: Call, table: WriteTable, limit: str) -> None:
    result = call("discover", table(), "--limit", limit)
    assert result.code == 2 and "limit" in result.err and "air_fl" in result.err and len(result.err.splitlines()) == 1
