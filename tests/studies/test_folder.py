"""Parts of a study: however the rows come in, and wherever a kill falls, each run is there once in the end."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import OutputError
from adaptive_flot.studies import folder as folder_module
from adaptive_flot.studies.folder import StudyFolder, locked


def row_of(seed: int) -> dict[str, Any]:
    """A row; not all have the same columns."""
    names = {"run": f"a-{seed}", "scenario": "s", "controller": "c", "estimator": "e", "seed": seed}
    if seed == 3:
        return {**names, "outcome": "failed", "message": "Error: x"}
    status = "status_missing" if seed % 2 else "status_projected"
    return {**names, "outcome": "ok", "message": "", "fit_n": seed / 7, status: seed}


ROWS = [row_of(seed) for seed in range(8)]
ORDER = [row["run"] for row in ROWS]


def timing(row: dict[str, Any]) -> dict[str, Any]:
    return {"run": row["run"], "seconds": 0.5}


def add(folder: StudyFolder, rows: list[dict[str, Any]]) -> None:
    folder.add(rows, [timing(row) for row in rows])


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """All rows at once, in order."""
    path = tmp_path_factory.mktemp("expected")
    with locked(path) as folder:
        add(folder, ROWS)
        folder.complete(ORDER)
    return (path / "runs.parquet").read_bytes()


@given(order=st.permutations(ROWS), cuts=st.sets(st.integers(1, 7)), merged=st.booleans())
def test_finished_table_has_the_same_bytes_however_the_rows_came_in(
    tmp_path_factory: pytest.TempPathFactory,
    expected: bytes,
    order: list[dict[str, Any]],
    cuts: set[int],
    merged: bool,
) -> None:
    path = tmp_path_factory.mktemp("study")
    edges = [0, *sorted(cuts), len(order)]
    for i, (a, b) in enumerate(pairwise(edges)):
        with locked(path) as folder:  # opened again each time, as after a kill
            assert folder.done() == {row["run"] for row in order[:a]}
            add(folder, order[a:b])
            if merged and i % 2:
                folder.merge()
    with locked(path) as folder:
        folder.complete(ORDER)
        assert folder.done() == set(ORDER)
    assert (path / "runs.parquet").read_bytes() == expected
    assert sorted(f.name for f in path.iterdir()) == ["runs.parquet", "timings.parquet"]
    assert pd.read_parquet(path / "timings.parquet")["run"].tolist() == ORDER


class Killed(BaseException):
    """The process ends here."""


@pytest.mark.parametrize("at", range(5))
@pytest.mark.parametrize("what", ["merge", "complete"])
def test_a_kill_between_any_two_steps_of_a_merge_loses_and_doubles_nothing(
    tmp_path: Path, expected: bytes, monkeypatch: pytest.MonkeyPatch, what: str, at: int
) -> None:
    with locked(tmp_path) as folder:
        add(folder, ROWS[:5])
        add(folder, ROWS[5:])
    left = at

    def unlink(self: Path, missing_ok: bool = False) -> None:
        nonlocal left
        if "parquet" in self.suffix and not self.name.startswith("."):
            left -= 1
            if left < 0:
                raise Killed
        original(self, missing_ok)

    original = Path.unlink
    with monkeypatch.context() as patch, locked(tmp_path) as folder:
        patch.setattr(Path, "unlink", unlink)
        try:
            folder.merge() if what == "merge" else folder.complete(ORDER)
        except Killed:
            pass
        else:
            assert at >= 4  # two kinds, two parts each
    with locked(tmp_path) as folder:
        assert folder.done() == set(ORDER) and sorted(folder.table()["run"]) == ORDER
        folder.complete(ORDER)
    assert (tmp_path / "runs.parquet").read_bytes() == expected
    assert len(pd.read_parquet(tmp_path / "timings.parquet")) == len(ORDER)


def test_many_parts_are_merged_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder_module, "MOST_PARTS", 3)
    with locked(tmp_path) as folder:
        for row in ROWS:
            add(folder, [row])
        assert len(list(folder.parts.glob("*-runs.parquet"))) < 5
        assert sorted(folder.table()["run"]) == ORDER


def test_a_half_written_part_of_a_killed_sweep_is_removed(tmp_path: Path) -> None:
    with locked(tmp_path) as folder:
        add(folder, ROWS[:2])
    (tmp_path / "parts" / ".adaptive-flot-x.parquet").write_bytes(b"PAR1 half")
    with locked(tmp_path) as folder:
        assert folder.done() == {"a-0", "a-1"}
    assert not list(tmp_path.rglob(".adaptive-flot-*"))


def test_failed_runs_are_forgotten_on_request_only(tmp_path: Path) -> None:
    with locked(tmp_path) as folder:
        add(folder, ROWS)
        folder.complete(ORDER)
        assert folder.forget("failed") == 1 and folder.done() == set(ORDER) - {"a-3"}
        assert folder.forget("failed") == 0


def test_a_folder_that_can_not_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="give another folder"), locked(tmp_path / "file" / "out"):
        pass
