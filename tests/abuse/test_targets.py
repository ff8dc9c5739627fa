"""No output option costs a user an input, and what can not be written is said before any work."""

from __future__ import annotations

import os
import typing
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from typer.models import ArgumentInfo

from adaptive_flot.cli import app
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.commands.runs.run_files import write_json
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.cli.conftest import Call, Result, WriteScenario, WriteTable
from tests.runner.commands.test_runs_table import closed_loop_summary

MODULE = "from estimators.fixed import Fixed as Own\n"
ESTIMATE = ["estimate", "rec.csv", "--cell", "cell.yaml", "--estimator", "own.py:Own"]
RUN = ["run", "short.yaml", "--estimator", "own.py:Own"]
DRAWS = ["--cell", "ranges.yaml", "--draws", "32"]
STUDY = {"description": "Two", "scenarios": ["short.yaml"], "estimators": ["fixed"], "seeds": [1]}

# command without its outputs, the option of an output, and the inputs that it must not overwrite
CASES = [
    (["simulate", "rec.csv", "--cell", "cell.yaml"], "--out", ["rec.csv", "cell.yaml"]),
    (["simulate", "rec.csv", "--model", "model.yaml"], "--out", ["rec.csv", "model.yaml", "cell.yaml"]),
    (["simulate", "rec.csv", *DRAWS], "--out", ["rec.csv", "ranges.yaml", "cell.yaml"]),
    *(
        (["simulate", "rec.csv", *DRAWS, "--out", "new.csv"], option, ["rec.csv", "ranges.yaml", "cell.yaml"])
        for option in ("--report", "--json")
    ),
    *((ESTIMATE, option, ["rec.csv", "cell.yaml", "own.py"]) for option in ("--json", "--save-cell")),
    (["estimate", "rec.csv", "--model", "model.yaml"], "--save-model", ["rec.csv", "model.yaml", "cell.yaml"]),
    *((["discover", "rec.csv", "--model", "model.yaml"], "--json", [name]) for name in ("rec.csv", "cell.yaml")),
    (["discover", "rec.csv", "--model", "model.yaml"], "--save-model", ["model.yaml", "cell.yaml"]),
    (RUN, "--json", ["short.yaml", "cell.yaml", "own.py"]),
    ([*RUN, "--record", "rec.csv", "--map", "map.yaml"], "--json", ["rec.csv", "map.yaml"]),
    *((["compare", "done"], option, ["done/summary.json"]) for option in ("--json", "--markdown")),
    (["import", "rec.csv", "--map", "map.yaml", "--cell", "cell.yaml"], "--out", ["rec.csv", "map.yaml", "cell.yaml"]),
    (["serve-plant", "short.yaml"], "--write-link", ["short.yaml"]),
    (["export", "link.yaml"], "--out", ["link.yaml"]),
]
FOLDERS = [
    (["estimate", "pem.csv"], "."),
    (["sweep", "study.json"], "."),
    (["discover", "verdict.json"], "."),
    (["run", "summary.json"], "."),
    (["compare", "comparison.html"], "."),
]
"""A result in the folder of the results has the name of an input."""
INPUT_OPTIONS = {"--map", "--record", "--reference", "--certificates"}
READS_NOTHING = {("certificates", "--out")}
"""It writes into a folder, and refuses to where one of its files is: see `tests/live/processes/test_server.py`."""

SPELLINGS: dict[str, Callable[[Path], str]] = {
    "as given": str,
    "another path": lambda path: f"nowhere/../{path}",
    "absolute": lambda path: str(path.absolute()),
    "symbolic link": lambda path: _linked(path, os.symlink),
    "hard link": lambda path: _linked(path, os.link),
}


def _linked(path: Path, link: Callable[[Path, Path], None]) -> str:
    other = Path(f"other{path.suffix}")
    link(path.absolute(), other)
    return str(other)


@pytest.fixture
def inputs(scenario: WriteScenario, table: WriteTable, tmp_path: Path) -> dict[Path, bytes]:
    """Inputs of every command, and their content."""
    table().rename(tmp_path / "rec.csv")
    (tmp_path / "nowhere").mkdir()
    (tmp_path / "cell.yaml").write_bytes(cell_file().read_bytes())
    (tmp_path / "model.yaml").write_text("model: flotation\ncell: cell.yaml\n")
    (tmp_path / "ranges.yaml").write_text("cell: cell.yaml\nuncertain:\n  n: {share: 0.02}\n  C: {share: 0.05}\n")
    (tmp_path / "own.py").write_text(MODULE)
    (tmp_path / "map.yaml").write_text("grid: {step: 1 s}\n")
    drift = load_scenario("closed_loop_drift")
    (tmp_path / "link.yaml").write_text(link_text(drift, "opc.tcp://127.0.0.1:4840/none", tmp_path / "none", speed=1.0))
    scenario({"cell": "cell.yaml"})
    write_json(tmp_path / "done" / "summary.json", closed_loop_summary(1))
    for name in ("pem.csv", "verdict.json"):
        (tmp_path / name).write_bytes((tmp_path / "rec.csv").read_bytes())
    (tmp_path / "summary.json").write_bytes((tmp_path / "short.yaml").read_bytes())
    (tmp_path / "comparison.html").write_text("no result, but an input all the same")
    (tmp_path / "study.json").write_text(yaml.safe_dump(STUDY))
    return {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}


def check(result: Result, kept: dict[Path, bytes], tmp_path: Path, *says: str) -> None:
    assert result.code == 2 and result.out == "" and result.err.count("\n") == 1, result
    assert all(part in result.err for part in says), result.err
    assert {file: file.read_bytes() for file in kept} == kept
    new = {f for f in tmp_path.rglob("*") if f.is_file() and f not in kept and "__pycache__" not in f.parts}
    assert {f.stem for f in new} <= {"other"}, "something was written"


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize(
    ("command", "option", "named"),
    [(command, option, name) for command, option, names in CASES for name in names],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_no_output_overwrites_an_input(
    call: Call,
    inputs: dict[Path, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: list[str],
    option: str,
    named: str,
    spelling: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    target = SPELLINGS[spelling](Path(named))
    check(call(*command, option, target), inputs, tmp_path, f"{option}: {target}", "is an input", Path(named).name)


@pytest.mark.parametrize(("command", "folder"), FOLDERS, ids=lambda value: " ".join(value))
def test_no_result_in_a_folder_overwrites_an_input(
    call: Call, inputs: dict[Path, bytes], tmp_path: Path, command: list[str], folder: str
) -> None:
    check(call(*command, "--out", folder), inputs, tmp_path, "--out: ", "is an input", command[1])


@pytest.mark.parametrize("there", [True, False])
def test_no_json_overwrites_a_table_that_was_not_read(
    call: Call, inputs: dict[Path, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    """`--json old.csv` in place of `--reference old.csv` took the only copy of a record."""
    monkeypatch.chdir(tmp_path)
    result = call("discover", "rec.csv", "--no-report", "--json", "pem.csv" if there else "new.csv")
    if there:
        check(result, inputs, tmp_path, "--json: pem.csv is there, and a table")
    else:
        assert result.code == 0 and (tmp_path / "new.csv").is_file()


def test_no_output_of_draws_overwrites_another(call: Call, inputs: dict[Path, bytes], tmp_path: Path) -> None:
    result = call("simulate", "rec.csv", *DRAWS, "--out", "new.csv", "--report", "nowhere/../new.csv")
    check(result, inputs, tmp_path, "--report: ", "is written by --out already")


def test_no_output_overwrites_another(call: Call, inputs: dict[Path, bytes], tmp_path: Path) -> None:
    result = call(*ESTIMATE, "--json", "new.yaml", "--save-cell", "nowhere/../new.yaml")
    check(result, inputs, tmp_path, "--save-cell: ", "is written by --json already")


UNWRITABLE = {
    "a folder": "nowhere",
    "below a file": "rec.csv/new.json",
    "too long a name": "x" * 300,
    "a device": "/dev/null",
}


@pytest.mark.parametrize("kind", UNWRITABLE)
@pytest.mark.parametrize(
    ("command", "option"),
    [(c, o) for c, o, _ in CASES if o != "--save-model"],
    ids=lambda v: v if v[0] == "-" else v[0],
)
def test_what_can_not_be_written_is_said_before_any_work(
    call: Call, inputs: dict[Path, bytes], tmp_path: Path, command: list[str], option: str, kind: str
) -> None:
    check(call(*command, option, UNWRITABLE[kind]), inputs, tmp_path, f"{option}: {UNWRITABLE[kind]}")
    assert not (tmp_path / "results").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
@pytest.mark.parametrize("what", ["file", "folder"])
def test_no_permission_is_said_before_any_work(
    call: Call, inputs: dict[Path, bytes], tmp_path: Path, what: str
) -> None:
    target = tmp_path / "nowhere" / "kept.json"
    target.write_text("kept")
    (target if what == "file" else target.parent).chmod(0o500)
    result = call(*RUN, "--json", target if what == "file" else target.with_name("new.json"))
    target.parent.chmod(0o700)
    check(result, {**inputs, target: b"kept"}, tmp_path, "--json: ")


def test_every_output_option_is_in_these_tables() -> None:
    """A new command or option that writes must be added to `CASES`."""
    outputs = set()
    for command in app.registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__.replace("_", "-")
        for parameter, kind in typing.get_type_hints(command.callback, include_extras=True).items():
            annotated = typing.get_args(kind)
            if (
                len(annotated) == 2
                and annotated[0] in (Path, Path | None)
                and not isinstance(annotated[1], ArgumentInfo)
            ):
                outputs.add((name, f"--{parameter.rstrip('_').replace('_', '-')}"))
    tried = {(command[0], option) for command, option, _ in CASES} | {(command[0], "--out") for command, _ in FOLDERS}
    assert {o for o in outputs if o[1] not in INPUT_OPTIONS} - READS_NOTHING == tried


def test_a_link_file_that_somebody_edited_is_kept(call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The same command again finds its own file, and goes on."""
    served: list[object] = []
    monkeypatch.setattr("adaptive_flot.live.plant.serve.serve", lambda *given, **options: served.append(given))
    command = ["serve-plant", "closed_loop_drift", "--write-link", "link.yaml"]
    for times in (1, 2):
        assert call(*command).code == 0 and len(served) == times
    (tmp_path / "link.yaml").write_text("mine: all\n")
    result = call(*command)
    assert result.code == 2 and result.out == "" and result.err.count("\n") == 1 and len(served) == 2
    assert "--write-link: link.yaml is there already" in result.err
    assert (tmp_path / "link.yaml").read_text() == "mine: all\n"
