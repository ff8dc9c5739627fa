"""Every mistake of a user: exit code 2, one line that names the file and says what to do, nothing half-written."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
import pytest

from tests.cli.conftest import Call, Result, WriteScenario, WriteTable

COMMANDS = {
    "simulate": ["simulate", "record.csv", "--out", "r/out.csv"],
    "accurate": ["simulate", "record.csv", "--out", "r/out.csv", "--accurate"],
    "estimate": ["estimate", "record.csv", "--out", "r", "--json", "r/copy.json", "--save-cell", "r/cell.yaml"],
}


def check(result: Result, folder: Path, *says: str) -> None:
    assert result.code == 2, result
    assert result.out == "" and "Traceback" not in result.err
    assert len(result.err.splitlines()) == 1 and result.err.startswith("adaptive-flot: ")
    for part in says:
        assert part in result.err
    left = {str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file()}
    assert left <= {"record.csv", "short.yaml", "cell.yaml"}


def _set(column: str, row: int, value: float | str | None) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table[column] = table[column].astype(object)
        table.loc[row, column] = value
        return table

    return change


# line 7 of the file is row 5 of the table
TABLES: Mapping[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], list[str]]] = {
    "missing input": (lambda t: t.drop(columns="air_flow_m3_s"), ["'air_flow_m3_s' is missing"]),
    "missing time": (lambda t: t.drop(columns="time_s"), ["'time_s' is missing"]),
    "wrong unit of an input": (
        lambda t: t.rename(columns={"air_flow_m3_s": "air_flow_m3_h"}),
        ["'air_flow_m3_h'", "multiply the column by 0.000277778 and name it", "'air_flow_m3_s'"],
    ),
    "wrong unit of the time": (lambda t: t.rename(columns={"time_s": "time_min"}), ["'time_min'", "'time_s'"]),
    "wrong unit of an output": (
        lambda t: t.rename(columns={"concentrate_grade": "concentrate_grade_pct"}),
        ["'concentrate_grade_pct'", "'concentrate_grade'"],
    ),
    "misspelt input": (
        lambda t: t.rename(columns={"feed_flow_m3_s": "fed_flow_m3_s"}),
        ["'feed_flow_m3_s' is missing", "did you mean 'fed_flow_m3_s'"],
    ),
    "renamed input": (
        lambda t: t.rename(columns={"air_flow_m3_s": "airflow"}),
        ["'air_flow_m3_s' is missing", "did you mean 'airflow'? Known: airflow)"],
    ),
    "time not increasing": (_set("time_s", 5, 2.0), ["time does not increase in line 7", "sort the rows"]),
    "time not uniform": (_set("time_s", 20, 20.4), ["not uniform", "line 22"]),
    "time missing": (_set("time_s", 5, None), ["'time_s' is empty in line 7"]),
    "input missing": (_set("air_flow_m3_s", 5, None), ["'air_flow_m3_s'", "line 7", "can not be missing"]),
    "text in an input": (_set("air_flow_m3_s", 5, "off"), ["'air_flow_m3_s'", "line 7", "'off'"]),
    "text in an output": (_set("concentrate_grade", 5, "bad"), ["'concentrate_grade'", "line 7", "'bad'"]),
    "air above its range": (_set("air_flow_m3_s", 5, 0.5), ["air_flow = 0.5 m3/s", "time 5 s"]),
    "level above the cell": (_set("level_setpoint_m", 5, 0.6), ["level_setpoint = 0.6 m", "time 5 s", "0.47952"]),
    "negative feed": (_set("feed_flow_m3_s", 5, -1e-4), ["feed_flow = -0.0001 m3/s", "time 5 s"]),
    "one row": (lambda t: t.iloc[:1], ["1 row", "at least 2"]),
    "no rows": (lambda t: t.iloc[:0], ["no rows"]),
}


@pytest.mark.parametrize("command", ["simulate", "estimate"])
@pytest.mark.parametrize("mistake", TABLES)
def test_a_wrong_table(call: Call, table: WriteTable, tmp_path: Path, mistake: str, command: str) -> None:
    change, says = TABLES[mistake]
    table(change)
    check(call(*COMMANDS[command]), tmp_path, "record.csv", *says)


FILES = {
    "empty": (b"", "the file is empty"),
    "blank": (b"\n \n\n", "record.csv"),
    "binary": (bytes(range(256)) * 8, "not a"),
    "separators": (b",,,\n,,,\n", "record.csv"),
    "semicolons": (b"time_s;air_flow_m3_s\n0;1\n1;1\n", "separated by a semicolon"),
}


@pytest.mark.parametrize("command", ["simulate", "estimate"])
@pytest.mark.parametrize("kind", FILES)
def test_a_file_that_is_no_table(call: Call, tmp_path: Path, kind: str, command: str) -> None:
    content, says = FILES[kind]
    (tmp_path / "record.csv").write_bytes(content)
    check(call(*COMMANDS[command]), tmp_path, "record.csv", says)


@pytest.mark.parametrize("command", COMMANDS)
def test_no_file_at_all(call: Call, tmp_path: Path, command: str) -> None:
    check(call(*COMMANDS[command]), tmp_path, "record.csv", "no such file")


@pytest.mark.parametrize("command", ["simulate", "estimate"])
def test_a_folder_for_a_table(call: Call, tmp_path: Path, command: str) -> None:
    (tmp_path / "record.csv").mkdir()
    check(call(*COMMANDS[command]), tmp_path, "record.csv")


@pytest.mark.parametrize("command", ["simulate", "accurate"])
@pytest.mark.parametrize(
    ("column", "value", "says"),
    [
        ("n", 9.0, ["n = 9", "[0.3, 5]"]),
        ("C", 0.5, ["C = 0.5 m^n/s", "[1e-06, 0.1]"]),
        ("n", None, ["growth_exponent", "line 7", "every row or in none"]),
    ],
)
def test_a_parameter_column_outside_its_range(
    call: Call, table: WriteTable, tmp_path: Path, command: str, column: str, value: float | None, says: list[str]
) -> None:
    table(lambda t: _set(column, 5, value)(t.assign(**{column: 1.0 if column == "n" else 6e-4})))
    check(call(*COMMANDS[command]), tmp_path, "record", *says)


@pytest.mark.parametrize("command", ["simulate", "accurate"])
@pytest.mark.parametrize(
    ("feed", "setpoint"), [(1.7e-3, 0.38), (1.67e-4, 0.001)], ids=["pulp over the lip", "froth breaks down"]
)
def test_inputs_that_drive_the_cell_out_of_its_range(
    call: Call, table: WriteTable, tmp_path: Path, command: str, feed: float, setpoint: float
) -> None:
    def change(t: pd.DataFrame) -> pd.DataFrame:
        longer = pd.DataFrame({"time_s": range(300)}).join(
            t.drop(columns="time_s").iloc[:1].loc[[0] * 300].reset_index()
        )
        longer.loc[5:, "feed_flow_m3_s"], longer.loc[5:, "level_setpoint_m"] = feed, setpoint
        return longer

    table(change)
    check(call(*COMMANDS[command]), tmp_path, "record", "at time ")


def test_too_short_a_record_to_fit(call: Call, table: WriteTable, tmp_path: Path) -> None:
    """Eleven unknowns (two parameters, nine states), two outputs."""
    table(lambda t: t.iloc[:9])
    check(call(*COMMANDS["estimate"]), tmp_path, "record", "for 11 unknowns")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--fit", "growth"], ["'growth'", "growth_exponent"]),
        (["--output", "grade"], ["'grade'", "concentrate_grade"]),
        (["--output", "recovery"], ["'recovery' is not measured"]),
        (["--estimator", "rpm"], ["'rpm'", "did you mean 'rpem'"]),
        (["--estimator", "nowhere:Mine"], ["no module 'nowhere'"]),
        (["--model", "flotaton"], ["'flotaton'", "did you mean 'flotation'"]),
        (["--model", "nowhere:make"], ["no module 'nowhere'"]),
        (["--cell", "lab_88l"], ["lab_88l", "did you mean 'lab_87l'"]),
        (["--model", "cascaded-tanks", "--cell", "lab_87l"], ["takes no cell"]),
        (["--model", "cascaded-tanks"], ["record.csv", "pump_voltage"]),
    ],
    ids=" ".join,
)
def test_wrong_names_in_the_options_of_estimate(
    call: Call, table: WriteTable, tmp_path: Path, options: list[str], says: list[str]
) -> None:
    table()
    check(call("estimate", "record.csv", "--out", "r", *options), tmp_path, *says)


CELLS = {
    "no unit": ("unit: m2, ", "", ["cell.cross_section_area has no unit"]),
    "bare number": ("{value: 0.48,    unit: m,       source: part II}", "0.48", ["cell.height = 0.48 has no unit"]),
    "other unit": ("unit: Pa s,", "unit: mPa s,", ["pulp.water_viscosity", "'mPa s'", "unit: Pa s"]),
    "outside its range": ("value: 0.2, ", "value: 0.95, ", ["pulp.solids_fraction = 0.95", "[0, 0.9]"]),
    "text for a number": ("value: 0.48, ", "value: tall, ", ["cell.height", "'tall'"]),
    "unknown entry": ("  peclet:", "  peclett:", ["'peclett'", "did you mean 'peclet'"]),
    "missing entry": ("  gravity:", "  # gravity:", ["pulp.gravity is missing"]),
    "no YAML": ("cell:", "cell: [", ["not a YAML file"]),
    "no value at all": ("value: 1.67e-4, ", "value: [], ", ["operation.feed_flow"]),
    "not a number": ("value: 0.48, ", "value: .nan, ", ["cell.height = nan"]),
}


@pytest.mark.parametrize("command", [["simulate", "record.csv", "--out", "r/o.csv"], ["estimate", "record.csv"]])
@pytest.mark.parametrize("mistake", CELLS)
def test_a_wrong_cell_file(call: Call, table: WriteTable, tmp_path: Path, mistake: str, command: list[str]) -> None:
    from adaptive_flot.resources import cell_file

    table()
    old, new, says = CELLS[mistake]
    shipped = cell_file().read_text().replace("unit: m2,      source", "unit: m2, source")
    assert old in shipped
    (tmp_path / "cell.yaml").write_text(shipped.replace(old, new, 1))
    check(call(*command, "--cell", "cell.yaml"), tmp_path, "cell.yaml", *says)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"seedz": [1]}, ["'seedz'", "did you mean 'seeds'"]),
        ({"duration_s": "long"}, ["duration_s", "'long'"]),
        ({"inputs.air_flow_m3_s": ...}, ["'air_flow_m3_s' is missing"]),
        ({"initial_estimate.guess": {"n": 99.0}}, ["99", "[0.3, 5]"]),
        ({"initial_estimate.until_s": 2}, ["2 measurements of concentrate_grade for 2 unknowns"]),
        ({"cell": "cell.yaml"}, ["cell.yaml", "no such cell file"]),
        ({"estimators.rpem.options": {"forgetting": 3}}, ["forgetting = 3"]),
    ],
    ids=str,
)
def test_a_wrong_scenario(
    call: Call, scenario: WriteScenario, tmp_path: Path, changes: dict[str, object], says: list[str]
) -> None:
    scenario(changes)
    check(call("run", "short.yaml", "--out", "r"), tmp_path, "short.yaml", *says)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["short.yaml", "--estimator", "nowhere:Mine"], ["no module 'nowhere'"]),
        (["paper_scenaro_1"], ["paper_scenaro_1", "did you mean 'paper_scenario_1'"]),
        (["data/paper_scenario_1.yaml"], ["data/paper_scenario_1.yaml", "no such scenario file"]),
        (["."], ["no such scenario file"]),
        (["short.yaml", "--estimator", "rpm"], [": --estimator: unknown estimator 'rpm'; did you mean 'rpem'?"]),
        (["short.yaml", "--controller", "hld"], [": --controller: unknown controller 'hld'; did you mean 'hold'?"]),
    ],
    ids=lambda v: " ".join(v),
)
def test_wrong_names_in_the_arguments_of_run(
    call: Call, scenario: WriteScenario, tmp_path: Path, arguments: list[str], says: list[str]
) -> None:
    scenario()
    check(call("run", *arguments, "--out", "r"), tmp_path, *says)


def _targets(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "folder.csv").mkdir()
    return {
        "a folder": "folder.csv",
        "below a file": "record.csv/out.csv",
        "too long a name": "x" * 300 + ".csv",
        "where nobody can write": "/proc/nowhere/out.csv",
        "in the system": "/proc/out.csv",
    }


@pytest.mark.skipif(
    not os.path.isdir("/proc/self"), reason="needs the /proc of Linux as a place that can not be written"
)
@pytest.mark.parametrize(
    "kind", ["a folder", "below a file", "too long a name", "where nobody can write", "in the system"]
)
def test_an_output_that_can_not_be_written_is_named(call: Call, table: WriteTable, tmp_path: Path, kind: str) -> None:
    """By the name that was asked for, not by that of a temporary file."""
    table(lambda t: t.iloc[:5])
    target = _targets(tmp_path)[kind]
    result = call("simulate", "record.csv", "--out", target)
    check(result, tmp_path)
    assert Path(target).parts[0] in result.err and "/." not in result.err
    assert [f.name for f in tmp_path.iterdir() if f.name.startswith(".")] == []


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_results_of_a_run_that_can_not_be_written(
    call: Call, scenario: WriteScenario, tmp_path: Path, option: str
) -> None:
    scenario()
    (tmp_path / "taken").write_text("a file") if option == "--out" else (tmp_path / "taken").mkdir()
    options = ["--out", "taken"] if option == "--out" else ["--out", "r", "--json", "taken"]
    result = call("run", "short.yaml", "--estimator", "fixed", *options)
    assert result.code == 2 and len(result.err.splitlines()) == 1 and "taken" in result.err
    assert [f for f in tmp_path.rglob("*") if f.name.startswith(".")] == []
    if option == "--out":
        assert (tmp_path / "taken").read_text() == "a file"
