"""What nobody foresaw is one line too: a defect of the program, where it is, and how to see more."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from adaptive_flot.errors import ScenarioError
from adaptive_flot.runner.scenario import loading
from tests.cli.conftest import Call


def _fails_with(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fails() -> None:
        raise error

    monkeypatch.setattr(loading, "shipped_scenarios", fails)


def test_a_defect_is_one_line_with_its_place_and_exit_code_1(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    _fails_with(monkeypatch, RuntimeError("two\nlines"))
    result = call("scenarios")
    assert result.code == 1 and result.err.count("\n") == 1
    assert "defect of this program (adaptive_flot/cli/scenarios.py, line " in result.err
    assert "RuntimeError: two lines" in result.err and "--debug" in result.err


@pytest.mark.parametrize("arguments", [["--debug", "scenarios"], ["scenarios", "--debug"]], ids=" ".join)
def test_debug_shows_the_traceback_wherever_it_stands(
    call: Call, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    _fails_with(monkeypatch, RuntimeError("broken"))
    result = call(*arguments)
    assert result.code == 1 and "Traceback" in result.err and "raise error" in result.err
    assert result.err.splitlines()[-1].endswith("report it")


def test_debug_keeps_the_exit_code_of_a_mistake(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    _fails_with(monkeypatch, ScenarioError("x.yaml: wrong; correct it"))
    result = call("scenarios", "--debug")
    assert result.code == 2 and "Traceback" in result.err
    assert result.err.splitlines()[-1] == "adaptive-flot: x.yaml: wrong; correct it"


def test_no_memory_is_no_defect(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    _fails_with(monkeypatch, MemoryError())
    result = call("scenarios")
    assert result.code == 1 and "not enough memory" in result.err and "defect" not in result.err


def test_the_package_runs_as_a_module(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "adaptive_flot", "scenarios"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert "paper_scenario_1" in done.stdout and done.stderr == ""


def test_an_unknown_backend_of_matplotlib_is_left_out(tmp_path: Path) -> None:
    """In a process of its own: matplotlib reads the variable once, when it is imported."""
    code = (
        "import sys; from adaptive_flot.cli import main; sys.argv[1:] = ['scenarios']\n"
        "try: main()\nexcept SystemExit as end: assert not end.code\n"
        "import matplotlib  # as a report does"
    )
    environment = {**os.environ, "MPLBACKEND": "no_such_thing"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=environment, check=False
    )
    assert done.returncode == 0 and "paper_scenario_1" in done.stdout
    assert done.stderr == "adaptive-flot: MPLBACKEND=no_such_thing is no backend of matplotlib; going on without it\n"
