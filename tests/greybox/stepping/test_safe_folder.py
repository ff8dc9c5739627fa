"""Nothing is loaded that another user may have written."""

from __future__ import annotations

import os
from pathlib import Path

import casadi as ca
import pytest

from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.stepping.compiling import compiled as module
from adaptive_flot.greybox.stepping.compiling.compiled import (
    CompileError,
    CompileWarning,
    compile_function,
    compiler_problem,
)
from adaptive_flot.greybox.stepping.compiling.safe_folder import make_private, problem_of

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A file three folders below one of nobody else's."""
    file = tmp_path / "cache" / "adaptive-flot" / "compiled" / "f.so"
    make_private(file.parent)
    file.touch(mode=0o700)
    return file


def test_what_is_made_here_is_trusted(library: Path) -> None:
    assert problem_of(library, 3) is None
    assert [f.stat().st_mode & 0o777 for f in (library.parent, library.parents[1], library.parents[2])] == [0o700] * 3


@pytest.mark.parametrize("level", [0, 1, 2, 3])
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_what_others_may_write_is_refused(library: Path, level: int, mode: int) -> None:
    """The file, and each folder above it up to the cache root: who may write there may put another file in place."""
    path = [library, *library.parents][level]
    path.chmod(mode)
    problem = problem_of(library, 3)
    assert problem is not None and problem.startswith(f"{path}: others may write to it (mode {mode:o})")
    assert "\n" not in problem


def test_folders_beyond_the_root_are_not_asked(library: Path) -> None:
    library.parents[3].chmod(0o777)
    assert problem_of(library, 3) is None


def test_a_folder_in_which_each_may_remove_his_own_files_only_is_no_danger(library: Path) -> None:
    """As /tmp: what lies in it is this user's own, and stays."""
    library.parents[2].chmod(0o1777)
    assert problem_of(library, 3) is None
    library.chmod(0o1722)
    assert "others may write" in str(problem_of(library, 3))


@pytest.mark.parametrize("level", [0, 1, 3])
def test_what_belongs_to_another_user_is_refused(library: Path, level: int, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = os.geteuid()
    path = [library, *library.parents][level]
    if mine == 0:
        os.chown(path, 12345, -1)
        assert f"{path}: belongs to another user (number 12345)" in str(problem_of(library, 3))
    else:
        monkeypatch.setattr(os, "geteuid", lambda: mine + 1)
        assert f"{library}: belongs to another user (number {mine})" in str(problem_of(library, 3))


def test_a_link_is_followed_for_the_folder_and_refused_for_the_file(library: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").symlink_to(library.parent, target_is_directory=True)
    assert problem_of(tmp_path / "elsewhere" / "f.so", 3) is None
    (library.parent / "g.so").symlink_to(library)
    assert "a link or device" in str(problem_of(library.parent / "g.so", 3))
    library.parent.chmod(0o770)
    assert str(problem_of(tmp_path / "elsewhere" / "f.so", 3)).startswith(f"{library.parent}: others may write")


def function() -> ca.Function:
    x = ca.SX.sym("x")
    return ca.Function("guarded", [x], [x + 1.25], ["x"], ["y"])


@needs_compiler
@pytest.mark.parametrize("before", [False, True], ids=["before it is made", "after it was made"])
def test_a_shared_folder_is_refused_before_anything_in_it_is_loaded(
    tmp_path: Path, before: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both ways to machine code go on without it, and say why in one line."""
    folder = tmp_path / "compiled"
    monkeypatch.setattr(module, "cache_folder", lambda: folder)
    if before:
        assert float(compile_function(function())(1.0)) == 2.25
        Lanes(function(), {}, as_machine_code=True)
    make_private(folder)
    folder.chmod(0o777)
    monkeypatch.setattr(ca, "external", None)  # would fail: nothing may be loaded
    kept = set(folder.iterdir())
    with pytest.raises(CompileError, match="others may write to it"):
        compile_function(function())
    with pytest.warns(CompileWarning, match="guarded is not compiled: .*others may write to it"):
        lanes = Lanes(function(), {}, as_machine_code=True)
    assert lanes.library is None
    assert set(folder.iterdir()) == kept
    assert "others may write to it" in str(compiler_problem())
