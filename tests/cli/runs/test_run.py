"""`adaptive-flot run`: the files it writes and what they hold."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.resources import scenario_folder
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.cli.conftest import Call, WriteScenario

OWN = """
from estimators.fixed import Fixed

class Mine(Fixed):
    pass
"""


def test_it_writes_summary_tables_and_report(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    result = call("run", scenario(), "--out", "new/results")
    assert result.code == 0, result.err
    folder = tmp_path / "new" / "results"
    names = {f.name for f in folder.iterdir()}
    assert {"summary.json", "report.html", "fixed_schedule_seed1.csv", "rpem_schedule_seed1.csv"} <= names
    assert not any(n.startswith(".") for n in names)
    summary = json.loads((folder / "summary.json").read_text())
    assert list(summary) == ["scenario", "code", "runs"] and summary["scenario"] == "short"
    assert len(summary["runs"]) == 2
    for run in summary["runs"]:
        assert list(run) == ["estimator", "controller", "seed", "fit", "status_counts", "seconds", "options"]
        assert list(run["fit"]) == ["n", "C", "concentrate_grade"]
        assert run["status_counts"] == {"initialising": 30, "ok": 30}
    assert "report.html" in result.out and "rpem" in result.out
    page = (folder / "report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html") and "adaptive-flot run" in page


def test_files_and_summary_are_those_of_the_library(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    """The same scenario through Python: the same fits, the same rows."""
    file = scenario()
    call("run", file, "--out", "r")
    for entry, run in zip(
        json.loads((tmp_path / "r" / "summary.json").read_text())["runs"],
        run_scenario(load_scenario(file)),
        strict=True,
    ):
        assert entry["fit"] == run.fit
        back = pd.read_csv(tmp_path / "r" / f"{run.estimator}_schedule_seed1.csv")
        for column in ("n_estimate", "concentrate_grade_measured", "concentrate_grade_true"):
            np.testing.assert_allclose(back[column], run.table[column].astype(float), rtol=1e-11)


def test_estimators_and_seeds_can_be_given_repeatedly(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    options = ["--estimator", "rpem", "--estimator", "fixed", "--seed", "3", "--seed", "7", "--out", "r"]
    assert call("run", scenario(), *options).code == 0
    runs = json.loads((tmp_path / "r" / "summary.json").read_text())["runs"]
    assert [(r["seed"], r["estimator"]) for r in runs] == [(3, "rpem"), (3, "fixed"), (7, "rpem"), (7, "fixed")]
    assert len(list((tmp_path / "r").glob("*.csv"))) == 4
    assert runs[0]["fit"] != runs[2]["fit"]


def test_json_writes_the_summary_there_too(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    assert call("run", scenario(), "--estimator", "fixed", "--out", "r", "--json", "deep/copy.json").code == 0
    assert (tmp_path / "deep" / "copy.json").read_text() == (tmp_path / "r" / "summary.json").read_text()


def test_parquet_instead_of_csv(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    assert call("run", scenario(), "--estimator", "rpem", "--parquet", "--out", "r").code == 0
    assert list((tmp_path / "r").glob("*.csv")) == []
    table = pd.read_parquet(tmp_path / "r" / "rpem_schedule_seed1.parquet")
    assert len(table) == 60 and {"time_s", "n_true", "n_estimate", "status"} <= set(table.columns)


def test_results_go_into_a_folder_named_after_the_scenario(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    assert call("run", scenario(), "--estimator", "fixed").code == 0
    assert (tmp_path / "results" / "short" / "run" / "summary.json").is_file()


def test_a_second_run_replaces_the_files_of_the_first(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    call("run", scenario(), "--estimator", "fixed", "--out", "r")
    before = (tmp_path / "r" / "fixed_schedule_seed1.csv").read_text()
    call("run", scenario({"parameters.C.change": 0.1}), "--estimator", "fixed", "--out", "r")
    assert (tmp_path / "r" / "fixed_schedule_seed1.csv").read_text() != before


def test_an_own_estimator_beside_the_scenario(
    call: Call, scenario: WriteScenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "cli_own_estimator.py").write_text(OWN)
    moved = scenario().rename(tmp_path / "elsewhere" / "short.yaml")
    result = call("run", moved, "--estimator", "cli_own_estimator:Mine", "--estimator", "rpem", "--out", "r")
    monkeypatch.delitem(sys.modules, "cli_own_estimator")
    assert result.code == 0, result.err
    assert (tmp_path / "r" / "cli_own_estimator-Mine_schedule_seed1.csv").is_file()
    runs = json.loads((tmp_path / "r" / "summary.json").read_text())["runs"]
    assert [r["estimator"] for r in runs] == ["cli_own_estimator:Mine", "rpem"]


def test_what_a_closed_loop_earns_stands_before_the_fits(call: Call, tmp_path: Path) -> None:
    given = yaml.safe_load((scenario_folder() / "closed_loop_drift.yaml").read_text())
    short = {**given, "duration_s": 420, "parameters": {}}
    (tmp_path / "loop.yaml").write_text(yaml.safe_dump(short))
    result = call("run", "loop.yaml", "--controller", "pi", "--out", "r")
    assert result.code == 0, result.err
    assert result.out.index("Value") < result.out.index("Fit in percent")
