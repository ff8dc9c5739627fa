"""`adaptive-flot compare`: what it prints and writes, and one line for what it can not compare."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from adaptive_flot.console import lines as console
from adaptive_flot.runner.commands.runs.run_files import write_json
from tests.cli.conftest import Call, WriteScenario
from tests.runner.commands.test_runs_table import closed_loop_summary


def test_what_run_wrote_is_compared(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    assert call("run", scenario(), "--seed", "1", "--seed", "2", "--out", "r").code == 0
    result = call("compare", "r", "--json", "c/c.json", "--markdown", "c/c.md", "--out", "c")
    assert result.code == 0, result.err
    assert "rpem" in result.out and "comparison.html" in result.out
    (found,) = json.loads((tmp_path / "c" / "c.json").read_text())["comparisons"]
    runs = json.loads((tmp_path / "r" / "summary.json").read_text())["runs"]
    for contender in found["contenders"]:
        fits = [r["fit"]["C"] for r in runs if r["estimator"] == contender["estimator"]]
        assert contender["seeds"] == [1, 2]
        assert contender["metrics"]["fit_C"]["median"] == pytest.approx(sum(fits) / 2)
    assert (tmp_path / "c" / "comparison.html").read_text().lstrip().lower().startswith("<!doctype html")
    written = (tmp_path / "c" / "c.md").read_text()
    assert "| Controller |" in written and "fit of the estimates" in written.splitlines()[0]
    assert result.out.index("C [%]") < result.out.index("Estimates"), "the fits come first, then how the runs went"


def test_closed_loops_of_several_results(call: Call, tmp_path: Path) -> None:
    for seed in (1, 2):
        write_json(tmp_path / f"r{seed}" / "summary.json", closed_loop_summary(seed))
    result = call("compare", "r1", "r2")
    assert result.code == 0, result.err
    assert "Value [cu/h]" in result.out and "11.500" in result.out  # seeds 1 and 2 joined
    assert {f.name for f in tmp_path.iterdir()} == {"r1", "r2"}  # nothing is written unless asked for


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (["nowhere"], "nowhere: no such file or folder"),
        (["empty"], "empty: no results in this folder"),
        (["."], ".: no results in this folder (no summary.json, no Parquet table of runs); its folders r1, r2 have"),
        (["page.html"], "page.html: neither a folder nor a summary"),
        (["r1", "r1/summary.json"], "give each once"),
        (["r1", "r2"], "r2: scenario 'drift' differs from that of r1"),
        (["r1", "--out", "page.html"], "page.html"),
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line_and_nothing_is_written(call: Call, tmp_path: Path, given: list[str], says: str) -> None:
    write_json(tmp_path / "r1" / "summary.json", closed_loop_summary(1))
    write_json(tmp_path / "r2" / "summary.json", closed_loop_summary(1, conditions="other"))
    (tmp_path / "empty").mkdir()
    (tmp_path / "page.html").write_text("<html>")
    before = sorted(tmp_path.rglob("*"))
    result = call("compare", *given)
    assert result.code == 2 and result.out == "" and len(result.err.splitlines()) == 1
    assert result.err.startswith("adaptive-flot: ") and says in result.err
    assert sorted(tmp_path.rglob("*")) == before


def test_a_narrow_terminal_cuts_no_number(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a table does not fit, cells are broken between words: 0.81… would be of no use."""
    write_json(tmp_path / "r" / "summary.json", closed_loop_summary(1))
    monkeypatch.setattr(console, "PIPE_WIDTH", 72)
    result = call("compare", "r")
    assert result.code == 0 and "…" not in result.out and "economic_mpc" in result.out and "11.000" in result.out
