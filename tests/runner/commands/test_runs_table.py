"""The table of runs: what `run` writes comes back row by row, and what is no result is one clear line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import ResultError
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run_files import plain, run_summary, write_json
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.runs_table import KEYS, read_runs, run_rows
from adaptive_flot.runner.results.accounts import control_account
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario


def closed_loop_summary(seed: int, name: str = "drift", **head: Any) -> dict[str, Any]:
    """Summary of one closed-loop run with numbers of our own."""
    run = {
        "estimator": "rpem",
        "controller": "economic_mpc",
        "seed": seed,
        "fit": {"n": 90.0 + seed},
        "status_counts": {"ok": 100},
        "seconds": 1.0,
        "account": {"recovery": 0.8, "value_cu_h": 10.0 + seed},
        "control": {
            "solves": 4,
            "solve_median_s": 0.03,
            "solve_p99_s": 0.05,
            "status_counts": {"ok": 3, "retried": 1},
            "decided_by": {"economic_mpc": 100},
        },
    }
    return {"scenario": name, "conditions": "abc", "grade_limit": 0.2, **head, "runs": [run]}


def test_a_row_holds_every_number_of_its_run(scenario: Scenario, runs: list[Run]) -> None:
    rows = run_rows(run_summary(scenario, runs))
    assert len(rows) == 4
    for row, run in zip(rows, runs, strict=True):
        assert [row[k] for k in KEYS] == ["short", run.controller, run.estimator, run.seed]
        assert {k.removeprefix("fit_"): v for k, v in row.items() if k.startswith("fit_")} == run.fit
        assert {k.removeprefix("status_"): v for k, v in row.items() if k.startswith("status_")} == run.status_counts
    closed = run_rows(closed_loop_summary(3))[0]
    assert (closed["value_cu_h"], closed["solve_p99_s"], closed["control_retried"]) == (13.0, 0.05, 1)
    assert (closed["conditions"], closed["grade_limit"], closed["decided_economic_mpc"]) == ("abc", 0.2, 100)


def test_folder_summary_and_parquet_parts_give_the_same_table(
    scenario: Scenario, runs: list[Run], tmp_path: Path
) -> None:
    """Three ways in, one table: a study's parts need no summary."""
    write_json(tmp_path / "a" / "summary.json", run_summary(scenario, runs))
    (tmp_path / "b" / "parts").mkdir(parents=True)
    for i, run in enumerate(runs):
        part = pd.DataFrame(run_rows(plain(run_summary(scenario, [run]))))
        part.to_parquet(tmp_path / "b" / "parts" / f"part-{i}.parquet")
    runs[0].table.to_parquet(tmp_path / "b" / "series.parquet")  # a time series beside them is no table of runs
    folder, file, parts = (read_runs([tmp_path / p]) for p in ("a", "a/summary.json", "b"))
    for other in (file, parts):
        pd.testing.assert_frame_equal(other.drop(columns="result"), folder.drop(columns="result"), check_like=True)
    assert set(folder["result"]) == {str(tmp_path / "a")}


def test_several_results_and_several_scenarios_stand_in_one_table(tmp_path: Path) -> None:
    write_json(tmp_path / "one.json", closed_loop_summary(1))
    write_json(tmp_path / "two.json", [closed_loop_summary(2), closed_loop_summary(3, "feed", conditions="def")])
    table = read_runs([tmp_path / "one.json", tmp_path / "two.json"])
    assert table["scenario"].tolist() == ["drift", "drift", "feed"] and table["seed"].tolist() == [1, 2, 3]


def _write(content: str | bytes, name: str = "summary.json") -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        folder.mkdir(parents=True)
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)

    return make


def _time_series(folder: Path) -> None:
    folder.mkdir()
    pd.DataFrame({"time_s": [1.0]}).to_parquet(folder / "rpem.parquet")


WRONG: dict[str, tuple[Callable[[Path], None], str]] = {
    "nothing there": (lambda folder: None, "no such file or folder"),
    "empty folder": (lambda folder: folder.mkdir(), "no results in this folder"),
    "only a page": (_write("x", "report.html"), "no results in this folder"),
    "folder of results": (lambda folder: _write("{}")(folder / "inner"), "inner have: give those"),
    "broken JSON": (_write('{"scenario": '), "not a JSON summary"),
    "binary": (_write(bytes(range(256))), "not a JSON summary"),
    "other JSON": (_write('{"a": 1}'), "not a summary of runs \\(no 'runs' in it\\)"),
    "a number": (_write("3"), "not a summary of runs \\(its entries are of another kind\\)"),
    "a result of estimate": (_write(json.dumps({"data": "a", "fit": {}, "estimators": []})), "takes results of `run`"),
    "no runs": (_write('{"scenario": "a", "runs": []}'), "no run has finished"),
    "a time series": (_time_series, "no results in this folder"),
    "a broken part": (_write(b"PAR1", "part.parquet"), "not a Parquet file"),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_what_is_no_result_is_named(tmp_path: Path, mistake: str) -> None:
    make, says = WRONG[mistake]
    make(tmp_path / "r")
    with pytest.raises(ResultError, match=says) as caught:
        read_runs([tmp_path / "r"])
    assert "\n" not in str(caught.value) and str(tmp_path / "r") in str(caught.value)


def test_a_result_given_twice_and_scenarios_that_differ_are_refused(tmp_path: Path) -> None:
    write_json(tmp_path / "a" / "summary.json", closed_loop_summary(1))
    write_json(tmp_path / "b" / "summary.json", closed_loop_summary(2, conditions="other"))
    with pytest.raises(ResultError, match="give each once"):
        read_runs([tmp_path / "a", tmp_path / "a" / "summary.json"])
    with pytest.raises(ResultError, match=r"b: scenario 'drift' differs from that of .*a"):
        read_runs([tmp_path / "a", tmp_path / "b"])


def test_conditions_follow_what_is_asked_not_who_runs() -> None:
    scenario = load_scenario("closed_loop_drift")

    def changed(**update: Any) -> str:
        return conditions(replace(scenario, file=scenario.file.model_copy(update=update)))

    assert scenario.file.economics is not None and scenario.file.limits is not None
    same = conditions(scenario)
    assert changed(seeds=[7, 8], estimators={"fixed": scenario.file.estimators["fixed"]}, cases=[]) == same
    dearer = scenario.file.economics.model_copy(update={"air_per_m3": 2e-3})
    richer = scenario.file.limits.model_copy(update={"concentrate_grade": 0.21})
    others = [changed(economics=dearer), changed(limits=richer), changed(duration_s=1800.0), changed(parameters={})]
    assert len({same, *others}) == 5


def test_control_account_by_hand() -> None:
    """Two solves, one of them retried, and a second without measurement."""
    table = pd.DataFrame(
        {
            "control_status": ["ok", "ok", "retried", "ok", "missing"],
            "decided_by": ["schedule", "mpc", "mpc", "mpc", "mpc"],
            "solve_seconds": [np.nan, 0.01, 0.03, np.nan, np.nan],
        }
    )
    found = control_account(table)
    assert found["solves"] == 2 and found["solve_median_s"] == pytest.approx(0.02)
    assert found["solve_p99_s"] == pytest.approx(0.01 + 0.99 * 0.02)
    assert found["status_counts"] == {"ok": 1, "retried": 1, "missing": 1}
    assert found["decided_by"] == {"mpc": 4, "schedule": 1}
    none = control_account(table.drop(columns="solve_seconds"))
    assert (
        none["solves"] == 0 and np.isnan(none["solve_p99_s"]) and none["status_counts"] == {"retried": 1, "missing": 1}
    )
