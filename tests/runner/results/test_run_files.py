"""Result files: strict JSON, whole or not at all."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.contracts import Status
from adaptive_flot.errors import DataError, OutputError
from adaptive_flot.files import replace_file, replace_path, write_text
from adaptive_flot.greybox.data.tables import read_table, write_table
from adaptive_flot.runner.commands.runs.run_files import plain, run_summary, write_json, write_runs
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.scenario import Scenario


class Colour(Enum):
    RED = "a long text"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (float("nan"), None),
        (float("inf"), None),
        (np.float64("nan"), None),
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (np.bool_(True), True),
        (True, True),
        (None, None),
        ("text", "text"),
        (Status.PROJECTED, "projected"),
        (Colour.RED, "red"),
        ((1, 2.5), [1, 2.5]),
        (np.array([[1.0, np.nan], [np.inf, 2.0]]), [[1.0, None], [None, 2.0]]),
        (np.array(2.0), 2.0),
        (np.array([], dtype=float), []),
        ({1: {"a": [np.float64(1.0), np.nan]}}, {"1": {"a": [1.0, None]}}),
    ],
    ids=repr,
)
def test_plain_leaves_what_json_knows(value: Any, expected: Any) -> None:
    found = plain(value)
    assert found == expected and type(found) is type(expected)
    json.dumps(found, allow_nan=False)


def test_json_is_strict_and_numbers_come_back_to_the_bit(tmp_path: Path) -> None:
    file = tmp_path / "new" / "summary.json"
    write_json(file, {"a": 0.1 + 0.2, "b": float("nan")})

    def reject(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    assert json.loads(file.read_text(), parse_constant=reject) == {"a": 0.1 + 0.2, "b": None}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("old", [None, "old content"])
def test_an_interrupted_write_leaves_nothing_and_keeps_the_old_file(
    tmp_path: Path, old: str | None, error: type[BaseException]
) -> None:
    file = tmp_path / "table.csv"
    if old is not None:
        file.write_text(old)
    with pytest.raises(error), replace_path(file) as temporary:
        temporary.write_text("half")
        raise error
    assert [f.name for f in tmp_path.iterdir()] == (["table.csv"] if old else [])
    if old is not None:
        assert file.read_text() == old


def test_an_interrupted_stream_keeps_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    write_text(file, "old")
    with pytest.raises(RuntimeError), replace_file(file) as stream:
        stream.write("half")
        stream.flush()
        assert file.read_text() == "old"
        raise RuntimeError
    assert [f.name for f in tmp_path.iterdir()] == ["a.txt"] and file.read_text() == "old"


def test_a_finished_write_replaces_the_file_and_keeps_its_suffix_meanwhile(tmp_path: Path) -> None:
    """The suffix matters to whoever writes by it (pandas, matplotlib)."""
    file = tmp_path / "new" / "plot.png"
    with replace_path(file) as temporary:
        assert temporary.suffix == ".png" and temporary.parent == file.parent and not file.exists()
        temporary.write_text("whole")
    assert file.read_text() == "whole" and [f.name for f in file.parent.iterdir()] == ["plot.png"]
    assert file.stat().st_mode & 0o777 == 0o644


def test_an_interrupted_table_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(pd.DataFrame, "to_csv", fail)
    with pytest.raises(OutputError, match=r"t\.csv: can not be written \(disk full\)"):
        write_table(pd.DataFrame({"a": [1.0]}), tmp_path / "t.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_tables_come_back(tmp_path: Path, suffix: str) -> None:
    """Twelve digits in CSV, every bit in Parquet; missing values stay missing."""
    table = pd.DataFrame({"a": np.random.default_rng(0).normal(size=50) * 10.0 ** np.arange(-25, 25), "s": "x"})
    table.loc[3, "a"] = np.nan
    write_table(table, tmp_path / f"t{suffix}")
    back = read_table(tmp_path / f"t{suffix}")
    np.testing.assert_allclose(back["a"], table["a"], rtol=1e-11 if suffix == ".csv" else 0)
    assert (back["s"] == "x").all()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_runs_are_written_by_estimator_controller_and_seed(runs: list[Run], tmp_path: Path, suffix: str) -> None:
    paths = write_runs(runs, tmp_path, suffix)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        f"{name}_schedule_seed{seed}{suffix}" for name in ("fixed", "rpem") for seed in (1, 2)
    )
    for run, path in zip(runs, paths, strict=True):
        back = read_table(path)
        assert list(back.columns) == list(run.table.columns)
        np.testing.assert_allclose(back["n_estimate"], run.table["n_estimate"].astype(float), rtol=1e-11)


def test_summary_has_exactly_the_agreed_keys(scenario: Scenario, runs: list[Run]) -> None:
    summary = plain(run_summary(scenario, runs))
    assert list(summary) == ["scenario", "code", "runs"] and summary["scenario"] == "short"
    assert len(summary["runs"]) == 4
    for entry in summary["runs"]:
        assert list(entry) == ["estimator", "controller", "seed", "fit", "status_counts", "seconds", "options"]
        assert list(entry["fit"]) == ["n", "C", "concentrate_grade"]
    json.dumps(summary, allow_nan=False)


NOT_TABLES = {
    "empty": b"",
    "blank lines": b"\n\n\n",
    "header only": b"time_s,concentrate_grade\n",
    "only separators": b",,\n,,\n",
    "binary": bytes(range(256)),
    "png": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
    "zeros": b"\x00" * 50,
    "ragged": b"a,b\n1,2\n1,2,3,4\n",
    "open quote": b'a,b\n"1,2\n3,4\n',
    "utf-16": "time_s,a\n1,2\n".encode("utf-16"),
}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("kind", NOT_TABLES)
def test_what_is_no_table_is_a_data_error_with_its_name(tmp_path: Path, kind: str, suffix: str) -> None:
    file = tmp_path / f"data{suffix}"
    file.write_bytes(NOT_TABLES[kind])
    with pytest.raises(DataError) as caught:
        read_table(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)
