"""Damaged results: a study or `compare` says in one line which file is damaged; a refused study leaves nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from adaptive_flot.errors import StudyError
from adaptive_flot.runner.commands.runs.run_files import plain
from adaptive_flot.studies.folder import RUNS, TIMINGS, locked
from adaptive_flot.studies.study_file import load_study
from adaptive_flot.studies.sweep import sweep
from tests.cli.conftest import Call
from tests.runner.commands.test_runs_table import closed_loop_summary
from tests.studies.conftest import WriteStudy, at_hand, cluster

__all__ = ["at_hand", "cluster"]

RUN = {"scenario": "s", "controller": "c", "estimator": "e", "outcome": "ok", "message": ""}


def _rows(*seeds: int) -> list[dict[str, Any]]:
    return [{"run": f"abc-{seed}", "seed": seed, **RUN, "fit_n": 90.0} for seed in seeds]


DAMAGE: dict[str, Callable[[Path], object]] = {
    "truncated": lambda file: file.write_bytes(file.read_bytes()[:-9]),
    "cut in half": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "empty": lambda file: file.write_bytes(b""),
    "no Parquet": lambda file: file.write_text("run,seed\n1,2\n"),
    "another table": lambda file: pd.DataFrame({"time_s": [1.0]}).to_parquet(file),
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("kind", [RUNS, TIMINGS])
@pytest.mark.parametrize("merged", [True, False], ids=["whole", "part"])
def test_a_damaged_file_of_a_study_is_named_and_can_be_removed(
    tmp_path: Path, damage: str, kind: str, merged: bool
) -> None:
    with locked(tmp_path / "out") as folder:
        for seed in (1, 2):
            folder.add(_rows(seed), [{"run": f"abc-{seed}", "seconds": 1.0}])
        if merged:
            folder.complete(["abc-1", "abc-2"])
        file = min(tmp_path.rglob(f"*{kind}.parquet"))
        DAMAGE[damage](file)
        with pytest.raises(StudyError) as caught:
            folder.table(kind)
        assert str(file) in str(caught.value) and "remove it" in str(caught.value) and "\n" not in str(caught.value)
        file.unlink()
        assert len(folder.table(kind)) == (0 if merged else 1)


def test_times_that_are_gone_do_not_keep_a_study_from_its_end(tmp_path: Path) -> None:
    with locked(tmp_path) as folder:
        folder.add(_rows(1), [{"run": "abc-1", "seconds": 1.0}])
        folder.add(_rows(2), [{"run": "abc-2", "seconds": 2.0}])
        min(tmp_path.rglob("*timings.parquet")).unlink()
        folder.complete(["abc-1", "abc-2"])
    assert pd.read_parquet(tmp_path / "timings.parquet")["seconds"].isna().tolist() == [True, False]
    assert pd.read_parquet(tmp_path / "runs.parquet")["run"].tolist() == ["abc-1", "abc-2"]


REFUSED = {
    "no scheduler": ({}, ["--scheduler", "tcp://127.0.0.1:1"], "no scheduler answers"),
    "TLS without certificates": ({}, ["--scheduler", "tls://127.0.0.1:1"], "--scheduler tls://127.0.0.1:1"),
    "a wrong option": ({"estimators": {"rpem": {"use": "rpem", "options": {"forgetting": 3}}}}, [], "forgetting"),
    "a hundred million seeds": ({"seeds": {"count": 10**8}}, [], "seeds"),
    "too large a seed": ({"seeds": [2**63]}, [], "seeds"),
    "a last seed beyond the largest": ({"seeds": {"first": 2**63 - 2, "count": 3}}, [], "the largest"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_refused_study_leaves_nothing(
    call: Call, write_study: WriteStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr("adaptive_flot.studies.cluster.CONNECT_S", 1.0)
    changes, options, says = REFUSED[kind]
    write_study(changes)
    result = call("sweep", "study.yaml", "--out", "new/out", *options)
    assert result.code == 2 and result.err.count("\n") == 1 and says in result.err, result
    assert {f.name for f in tmp_path.iterdir()} == {"study.yaml", "short.yaml"}


def test_a_refused_study_leaves_a_folder_of_the_user_as_it_was(call: Call, write_study: WriteStudy) -> None:
    write_study({"estimators": {"rpem": {"use": "rpem", "options": {"forgetting": 3}}}})
    out = Path("out")
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    assert call("sweep", "study.yaml", "--out", "out").code == 2
    assert [f.name for f in out.iterdir()] == ["notes.txt"]


def test_a_damaged_part_ends_a_sweep_in_words(write_study: WriteStudy, tmp_path: Path, at_hand: None) -> None:
    """The file is removed, as the message says, and the study is as it would have been."""
    study = load_study(write_study({"seeds": [1]}))
    whole = sweep(study, tmp_path / "out").table
    file = tmp_path / "out" / "runs.parquet"
    DAMAGE["truncated"](file)
    with pytest.raises(StudyError, match="remove it"):
        sweep(study, tmp_path / "out")
    file.unlink()
    pd.testing.assert_frame_equal(sweep(study, tmp_path / "out").table, whole)


WRONG: dict[str, list[Any]] = {
    "runs.0.status_counts.ok": [[1, 2], {"a": 1}, "text"],
    "runs.0.fit.n": ["text", [1.0]],
    "runs.0.fit": [3, "text", [1]],
    "runs.0.account.value_cu_h": ["text", {"a": 1}],
    "runs.0.control.solve_p99_s": [{}, "text"],
    "runs.0.controller": [["a"], None, "", 3],
    "runs.0.seed": [[1], None, "one", 1.5, 2**70],
    "runs.0": [None, 3, "text"],
    "runs": [None, 3, "text"],
    "scenario": [None, 3, [1]],
    "conditions": [{"a": 1}, [1]],
    "grade_limit": [{"a": 1}, "text"],
}


@pytest.mark.parametrize(
    ("path", "value"), [(p, v) for p, values in WRONG.items() for v in values], ids=lambda value: repr(value)
)
def test_a_damaged_summary_is_one_line(call: Call, tmp_path: Path, path: str, value: Any) -> None:
    content = plain(closed_loop_summary(1))
    *way, last = path.split(".")
    place = content
    for key in way:
        place = place[int(key) if key.isdigit() else key]
    place[int(last) if last.isdigit() else last] = value
    (tmp_path / "summary.json").write_text(json.dumps(content))
    result = call("compare", "summary.json", "--json", "c.json", "--out", "c")
    assert result.code == 2 and result.out == "" and result.err.count("\n") == 1, result
    assert "summary.json: " in result.err and "defect" not in result.err
    assert {f.name for f in tmp_path.iterdir()} == {"summary.json"}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("kind", [RUNS, TIMINGS])
def test_a_damaged_study_is_one_line_of_compare(call: Call, tmp_path: Path, damage: str, kind: str) -> None:
    with locked(tmp_path / "out") as folder:
        folder.add(_rows(1), [{"run": "abc-1", "seconds": 1.0}])
    file = min(tmp_path.rglob(f"*{kind}.parquet"))
    DAMAGE[damage](file)
    result = call("compare", "out")
    assert result.code == 2 and result.err.count("\n") == 1 and "defect" not in result.err, result
    assert (file.name if damage != "another table" or kind == TIMINGS else "out") in result.err
