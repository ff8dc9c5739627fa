"""What the command says about itself."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from adaptive_flot.cli import app
from adaptive_flot.runner.scenario.loading import shipped_scenarios
from tests.cli.conftest import Call

COMMANDS = [c.name or c.callback.__name__.replace("_", "-") for c in app.registered_commands if c.callback is not None]
PROGRAM = Path(sys.executable).with_name("adaptive-flot")


def test_the_agreed_commands_are_there() -> None:
    assert {"run", "simulate", "import", "estimate", "compare", "scenarios"} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_has_an_example_that_it_would_accept(call: Call, command: str) -> None:
    """The options of the example are options of the command."""
    result = call(command, "--help")
    assert result.code == 0 and result.err == ""
    text = " ".join(result.out.split())
    example = text.split("Example: adaptive-flot ")[1].split()
    assert example[0] == command
    listed = text.split("Example:")[0]
    assert all(word in listed for word in example if word.startswith("--"))


def test_help_lists_every_command(call: Call) -> None:
    result = call("--help")
    assert result.code == 0 and all(command in result.out for command in COMMANDS)


def test_scenarios_lists_each_shipped_one_with_its_description(call: Call) -> None:
    result = call("scenarios")
    listed = re.sub(r"\n +", " ", result.out)
    lines = dict(line.split(maxsplit=1) for line in listed.splitlines())
    assert result.code == 0 and set(lines) == set(shipped_scenarios())
    assert all(len(text) > 20 for text in lines.values())
    assert max(map(len, result.out.splitlines())) <= 80


@pytest.mark.parametrize("arguments", [["run"], ["nope"], ["run", "x", "--nope"], ["simulate", "x.csv"]])
def test_wrong_usage_exits_with_2(call: Call, arguments: list[str]) -> None:
    result = call(*arguments)
    assert result.code == 2 and "Traceback" not in result.err and result.out == ""
    assert result.err.count("\n") == 1 and result.err.startswith("adaptive-flot: ") and "--help'" in result.err


def test_an_option_that_is_wrong_is_named_in_one_line(call: Call) -> None:
    said = "adaptive-flot: run: invalid value for '--seed': input should be a valid integer, got 'x'; see"
    result = call("run", "paper_scenario_1", "--seed", "x")
    assert result.code == 2 and result.err.startswith(said) and result.err.count("\n") == 1
    assert result.err.endswith("; see 'adaptive-flot run --help'\n")


def test_nothing_at_all_shows_the_help(call: Call) -> None:
    result = call()
    assert result.code == 2 and all(command in result.out + result.err for command in COMMANDS)


@pytest.mark.parametrize("arguments", [["run", "short.yaml", "--seed", "-1"], ["run", "short.yaml", "--seed", "one"]])
def test_a_seed_is_a_number_from_zero_on(call: Call, arguments: list[str]) -> None:
    result = call(*arguments)
    assert result.code == 2 and "--seed" in result.err


def test_the_installed_program_answers(tmp_path: Path) -> None:
    done = subprocess.run([PROGRAM, "scenarios"], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert "paper_scenario_1" in done.stdout and done.stderr == ""


def test_the_installed_program_turns_a_mistake_into_one_line(tmp_path: Path) -> None:
    done = subprocess.run([PROGRAM, "run", "nowhere.yaml"], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.splitlines()) == 1 and "nowhere.yaml" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_help_does_not_import_the_heavy_libraries() -> None:
    """So that it comes at once."""
    code = (
        "import sys, adaptive_flot.cli; print(sorted({'casadi', 'scipy', 'pandas', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_run_and_a_live_link_start_without_what_only_a_search_needs() -> None:
    """Its libraries take longer to load than all others together."""
    code = (
        "import sys, adaptive_flot.console.lines, adaptive_flot.live.program, adaptive_flot.live.shadow.worker; "
        "print(sorted({'adaptive_flot.discovery', 'matplotlib', 'scipy.stats', 'statsmodels'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
