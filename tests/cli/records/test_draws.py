"""`simulate --draws`: bands, a summary and a page; what is wrong is one line, and nothing is written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.uncertainty import draws as draws_module
from tests.cli.conftest import Call, WriteTable

RANGES = "uncertain:\n  n: {share: 0.02}\n  C: {share: 0.05}\n"
INPUTS = ["time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m"]


@pytest.fixture
def inputs(table: WriteTable, tmp_path: Path) -> Path:
    """A minute of inputs, and ranges beside them."""
    (tmp_path / "ranges.yaml").write_text(RANGES)
    return table(lambda t: t[INPUTS].head(60))


def test_bands_a_summary_and_a_page_are_written(call: Call, inputs: Path, tmp_path: Path) -> None:
    result = call(
        *("simulate", "record.csv", "--cell", "ranges.yaml", "--draws", 40),
        *("--out", "new/bands.csv", "--report", "new/page.html", "--json", "new/summary.json"),
    )
    assert result.code == 0, result.err
    assert "32 draws: new/bands.csv, new/page.html, new/summary.json" in result.out
    bands = pd.read_csv(tmp_path / "new" / "bands.csv")
    assert len(bands) == 60
    grade = bands[[f"concentrate_grade_q{q}" for q in ("05", "25", "50", "75", "95")]].to_numpy()
    assert np.all(np.diff(grade, axis=1) > 0)
    assert np.all(
        (grade[:, 0] < bands["concentrate_grade_nominal"]) & (bands["concentrate_grade_nominal"] < grade[:, -1])
    )
    summary = json.loads((tmp_path / "new" / "summary.json").read_text())
    assert summary["draws"] == 32 and set(summary["shares"]) == {"concentrate_grade", "recovery"}
    assert {share["label"] for share in summary["shares"]["recovery"]} == {"n", "C"}
    page = (tmp_path / "new" / "page.html").read_text()
    assert "Uncertain constants" in page and "ranges.yaml" in page and "32 draws of 2 constants" in page


def test_without_a_table_the_air_goes_up_in_steps(
    call: Call, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from adaptive_flot.uncertainty import default_inputs

    monkeypatch.setattr(default_inputs, "DURATION_S", 80)
    result = call("simulate", "--cell", "ranges.yaml", "--draws", 32, "--out", "bands.csv")
    assert result.code == 0, result.err
    air = pd.read_csv(tmp_path / "bands.csv")["air_flow_m3_s"]
    assert air.nunique() == 4 and air.iloc[0] == 9.05e-4 and air.iloc[-1] == 2.17e-3 and air.is_monotonic_increasing


WRONG: dict[str, tuple[str, tuple[str, ...]]] = {
    "no such file": ("", ("ranges.yaml", "no such file of ranges")),
    "a cell file": ("cell: {volume: 1}\n", ("no key 'uncertain'",)),
    "no constant": ("uncertain: {}\n", ("uncertain", "at least 1")),
    "unknown constant": ("uncertain: {nn: {share: 0.1}}\n", ("'nn'",)),
    "unknown key": ("uncertain: {n: {shere: 0.1}}\n", ("unknown key 'uncertain.n.shere'", "share")),
    "two kinds": ("uncertain: {n: {share: 0.1, std: 0.1}}\n", ("uncertain.n", "one of between, std and share")),
    "nothing": ("uncertain: {n: {}}\n", ("uncertain.n", "one of between, std and share")),
    "not positive": ("uncertain: {n: {share: -0.1}}\n", ("uncertain.n.share", "greater than 0")),
    "not finite": ("uncertain: {n: {std: .inf}}\n", ("uncertain.n.std", "finite")),
    "upside down": ("uncertain: {n: {between: [1.1, 0.9]}}\n", ("uncertain.n", "lower value first")),
    "outside": ("uncertain: {volume: {between: [-1, 1]}}\n", ("uncertain.volume", "within")),
    "a word": ("uncertain: {n: {share: much}}\n", ("uncertain.n.share", "'much'")),
    "named twice": ("uncertain: {n: {share: 0.1}, growth_exponent: {share: 0.1}}\n", ("named twice",)),
    "no cell": ("cell: nowhere.yaml\nuncertain: {n: {share: 0.1}}\n", ("nowhere.yaml", "no such cell file")),
    "no YAML": ("uncertain: [\n", ("ranges.yaml",)),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_ranges_are_one_line(call: Call, inputs: Path, tmp_path: Path, name: str) -> None:
    content, says = WRONG[name]
    (tmp_path / "ranges.yaml").unlink() if not content else (tmp_path / "ranges.yaml").write_text(content)
    refused(call, tmp_path, ["record.csv", "--cell", "ranges.yaml", "--draws", "40"], *says)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["record.csv", "--draws", "40"], "no --cell"),
        (["record.csv", "--cell", "ranges.yaml", "--draws", "10"], "give at least 32"),
        (["record.csv", "--cell", "ranges.yaml", "--draws", "0"], "give at least 32"),
        (["record.csv", "--cell", "ranges.yaml", "--draws", "-5"], "give at least 32"),
        (["record.csv", "--cell", "ranges.yaml", "--draws", "40", "--accurate"], "--accurate"),
        (["record.csv", "--cell", "ranges.yaml", "--draws", "40", "--model", "cascaded-tanks"], "--model"),
        (["record.csv", "--report", "page.html"], "--report needs --draws"),
        (
            ["record.csv", "--cell", "ranges.yaml", "--draws", "40", "--report", "r.txt"],
            "r.txt: the page is written as",
        ),
        (["record.csv", "--json", "summary.json"], "--json needs --draws"),
        ([], "no table of inputs"),
        (["nowhere.csv", "--cell", "ranges.yaml", "--draws", "40"], "nowhere.csv"),
    ],
)
def test_wrong_options_are_one_line(call: Call, inputs: Path, tmp_path: Path, arguments: list[str], says: str) -> None:
    refused(call, tmp_path, arguments, says)


def test_nothing_is_written_where_the_work_fails(
    call: Call, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draws_module, "_simulated", _all_leave)
    arguments = ["record.csv", "--cell", "ranges.yaml", "--draws", "40", "--report", "page.html", "--json", "s.json"]
    refused(call, tmp_path, arguments, "nominal constants")


def _all_leave(ensemble: object, record: object, parameters: np.ndarray) -> np.ndarray:
    del ensemble, record
    return np.full((len(parameters), 60, 6), np.nan)


def refused(call: Call, tmp_path: Path, arguments: list[str], *says: str) -> None:
    before = {f: f.read_bytes() for f in tmp_path.iterdir()}
    result = call("simulate", *arguments, "--out", "bands.csv")
    assert result.code == 2 and result.out == "" and result.err.count("\n") == 1, result
    assert all(part in result.err for part in says), result.err
    assert {f: f.read_bytes() for f in tmp_path.iterdir()} == before
