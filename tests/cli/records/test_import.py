"""`adaptive-flot import`: what it writes, what it asks, and that a refusal writes nothing."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.greybox.model import Model
from adaptive_flot.records.importing import import_table
from adaptive_flot.records.tag_map import TagMap, load_tag_map
from adaptive_flot.runner.commands.record_blocks import read_blocks
from tests.cli.conftest import Call, Result
from tests.records.exports import Plant, text

MAP = """\
time: {column: Timestamp, zone: UTC}
grid: {step: 10 s, hold_at_most: 30 s}
air_flow: {tag: FIC_101.PV, unit: L/min}
feed_flow: {tag: FIC_102.PV, unit: L/min}
level_setpoint: {tag: LIC_201.SP, unit: mm}
concentrate_grade: {tag: AI_401.PV, unit: "%", bad: [Bad Input], delay: 20 s}
"""
WriteExport = Callable[..., Path]


@pytest.fixture
def export(tmp_path: Path) -> WriteExport:
    """Write a tidy export, `export.csv`, after a change of its table."""

    def write(change: Callable[[pd.DataFrame], pd.DataFrame] = lambda t: t) -> Path:
        file = tmp_path / "export.csv"
        file.write_text(text(change(Plant().columns())))
        return file

    return write


def files(folder: Path) -> set[str]:
    return {f.name for f in folder.rglob("*") if f.is_file()}


def refused(result: Result, folder: Path, *there: str) -> str:
    """The line of a refusal; nothing was written."""
    assert result.code == 2 and result.out == "" and len(result.err.splitlines()) == 1
    assert files(folder) == {"export.csv", *there}
    return result.err


def test_it_writes_record_map_and_page_and_says_what_it_did(call: Call, export: WriteExport, tmp_path: Path) -> None:
    file = export()
    before = file.read_bytes()
    result = call("import", file, "--out", "record.parquet", "--yes")
    assert result.code == 0, result.err
    assert files(tmp_path) == {"export.csv", "record.parquet", "record.map.yaml", "record.quality.html"}
    assert file.read_bytes() == before
    shown = result.out
    assert max(map(len, shown.splitlines())) <= 80
    for word in ("FIC_101.PV", "L/min", "m3/s", "held up to 30 s", "59 rows, one every 10 s", "they move"):
        assert word in " ".join(shown.split()), word
    page = (tmp_path / "record.quality.html").read_text()
    assert page.lower().startswith("<!doctype html") and 'src="http' not in page and 'href="http' not in page
    assert load_tag_map(tmp_path / "record.map.yaml").quantities["air_flow"].unit == "L/min"


def test_map_and_page_of_before_are_kept(call: Call, export: WriteExport, tmp_path: Path) -> None:
    export()
    for name in ("record.map.yaml", "record.quality.html"):
        (tmp_path / name).write_text("mine")
    result = call("import", "export.csv", "--out", "record.csv", "--yes")
    assert result.code == 0 and "record.quality-2.html" in result.out
    kept = {"record.map.yaml", "record.quality.html"}
    assert {(tmp_path / name).read_text() for name in kept} == {"mine"}
    assert files(tmp_path) == {"export.csv", "record.csv", "record.map-2.yaml", "record.quality-2.html", *kept}


def test_the_map_that_it_wrote_gives_the_same_record_without_a_question(
    call: Call, export: WriteExport, tmp_path: Path
) -> None:
    call("import", export(), "--out", "one.parquet", "--yes")
    result = call("import", export(), "--out", "two.parquet", "--map", "one.map.yaml", "--no-report")
    assert result.code == 0 and "two.map.yaml" not in files(tmp_path) and "two.quality.html" not in files(tmp_path)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "one.parquet"), pd.read_parquet(tmp_path / "two.parquet"))


def test_a_map_that_is_there_is_never_overwritten(call: Call, export: WriteExport, tmp_path: Path) -> None:
    (tmp_path / "record.map.yaml").write_text("mine")
    assert call("import", export(), "--out", "record.csv", "--yes", "--no-report").code == 0
    assert (tmp_path / "record.map.yaml").read_text() == "mine"
    assert load_tag_map(tmp_path / "record.map-2.yaml").grid.step == "10 s"


def test_nobody_to_ask_and_nothing_accepted_is_refused(call: Call, export: WriteExport, tmp_path: Path) -> None:
    line = refused(call("import", export(), "--out", "record.parquet"), tmp_path)
    assert "found out and not given: time, grid, air_flow" in line and "--yes" in line and "--map" in line


def test_two_equal_readings_are_refused_even_with_yes(call: Call, export: WriteExport, tmp_path: Path) -> None:
    file = export(
        lambda t: t.assign(**{"Air flow B [L/min]": 90.0}).rename(columns={"FIC_101.PV [L/min]": "Air flow A [L/min]"})
    )
    line = refused(call("import", file, "--out", "record.parquet", "--yes"), tmp_path)
    assert "say which in a map (--map): 'air_flow: {tag: Air flow A}'" in line
    (tmp_path / "answer.yaml").write_text("air_flow: {tag: Air flow A}\n")
    result = call("import", file, "--out", "record.parquet", "--map", "answer.yaml", "--yes")
    assert result.code == 0, result.err
    assert load_tag_map(tmp_path / "record.map.yaml").quantities["air_flow"].unit == "L/min"


def test_on_a_terminal_it_asks(
    call: Call, export: WriteExport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which of two readings, then whether all is right; "no" writes nothing."""
    file = export(lambda t: t.assign(Timestamp=t["Timestamp"].str.replace("2026-03-14", "03/04/2026")))
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    answers = iter(["1", False, "1", True])
    monkeypatch.setattr("typer.prompt", lambda *a, **k: next(answers))
    monkeypatch.setattr("typer.confirm", lambda *a, **k: next(answers))
    result = call("import", file, "--out", "record.parquet")
    assert result.code == 2 and "nothing is written" in result.err and files(tmp_path) == {"export.csv"}
    assert "1  time: {format: day-first}" in result.out
    assert call("import", file, "--out", "record.parquet").code == 0
    assert pd.read_parquet(tmp_path / "record.parquet")["time_utc"].iloc[0] == pd.Timestamp("2026-04-03 06:00:10Z")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--out", "export.csv", "--yes"], "would be lost"),
        (["--out", "record.xlsx", "--yes"], "a table is written as .csv or .parquet"),
        (["--out", "record.csv", "--map", "nowhere.yaml"], "nowhere.yaml: can not be read"),
        (["--out", "record.csv", "--model", "cascaded-tanks", "--yes"], "no tag found for the input pump_voltage"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, export: WriteExport, tmp_path: Path, arguments: list[str], said: str
) -> None:
    assert said in refused(call("import", export(), *arguments), tmp_path)


def test_discover_takes_the_export_with_its_map_or_the_record(call: Call, export: WriteExport, tmp_path: Path) -> None:
    """The same verdict from the export and from the record that was imported from it."""
    (tmp_path / "map.yaml").write_text(MAP)
    assert call("import", export(), "--out", "record.parquet", "--map", "map.yaml", "--no-report").code == 0
    verdicts = []
    for source in ("export.csv", "record.parquet"):
        result = call("discover", source, "--map", "map.yaml", "--no-report", "--json", "verdict.json")
        assert result.code == 0 and result.out.startswith("insufficient: "), result.err
        verdicts.append(json.loads((tmp_path / "verdict.json").read_text()) | {"seconds": 0})
    assert verdicts[0] == verdicts[1]


def test_blocks_of_estimate_are_the_same_from_export_and_record(export: WriteExport, model: Model) -> None:
    tag_map = TagMap.model_validate(yaml.safe_load(MAP))
    record = import_table(export(), model, tag_map).table()
    one, other = read_blocks(export(), model, 0.6, tag_map), read_blocks(record, model, 0.6, tag_map)
    assert one.fit.name == "export" and len(one.fit) == len(other.fit)
    np.testing.assert_array_equal(one.test.inputs, other.test.inputs)
    np.testing.assert_array_equal(one.test.outputs, other.test.outputs)


def test_a_map_that_leaves_something_open_is_for_import_only(call: Call, export: WriteExport, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace(", unit: mm", ""))
    result = call("discover", export(), "--map", "map.yaml")
    assert "the map does not say level_setpoint; complete it" in refused(result, tmp_path, "map.yaml")


def test_an_analyser_shows_what_was_there_before_its_delay(call: Call, export: WriteExport, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    assert call("import", export(), "--out", "record.csv", "--map", "map.yaml").code == 0
    found = pd.read_csv(tmp_path / "record.csv")["concentrate_grade"]
    late = Plant().grade[3:]
    assert found[: len(late)].to_numpy() == pytest.approx(late, rel=1e-8) and found[len(late) :].isna().all()
