"""Protects the user's cache folder of compiled functions from growing for ever, and what is in use from being lost."""

from __future__ import annotations

import os
from pathlib import Path

import casadi as ca
import pytest

from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.kept import tidy, used

HOUR = 3600.0


def library(folder: Path, name: str, hours_ago: float) -> Path:
    path = folder / f"{name}.so"
    path.write_bytes(b"")
    os.utime(path, (path.stat().st_mtime - hours_ago * HOUR,) * 2)
    return path


def test_what_was_not_used_for_longest_is_deleted_and_nothing_else(tmp_path: Path) -> None:
    old = [library(tmp_path, f"f-{k}", hours_ago=10.0 + k) for k in range(8)]
    other = tmp_path / "notes.txt"
    other.write_text("kept")
    used(old[7])  # the oldest, but just loaded
    tidy(tmp_path, most=7, left=3)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["f-0.so", "f-1.so", "f-7.so", "notes.txt"]


def test_a_folder_that_is_small_stays_as_it_is(tmp_path: Path) -> None:
    there = {library(tmp_path, f"f-{k}", hours_ago=k) for k in range(7)}
    tidy(tmp_path, most=7, left=3)
    assert set(tmp_path.iterdir()) == there


def test_a_folder_that_is_not_there_and_a_library_that_is_gone_are_no_errors(tmp_path: Path) -> None:
    tidy(tmp_path / "nowhere", most=1, left=0)
    used(tmp_path / "gone.so")


@pytest.mark.skipif(compiled.compiler_problem() is not None, reason="needs a C compiler")
def test_loading_a_library_says_that_it_was_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "user_cache_path", lambda *_, **__: tmp_path)
    x = ca.SX.sym("x")
    twice = ca.Function("twice", [x], [2 * x])
    compiled.compile_function(twice)
    (made,) = (tmp_path / "compiled").glob("twice-*.so")
    os.utime(made, (0, 0))
    assert float(compiled.compile_function(twice)(1.5)) == 3.0
    assert made.stat().st_mtime > HOUR
