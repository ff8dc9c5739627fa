"""`adaptive-flot discover`: what it writes, and what it says of records and names that it can not use."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.report.discovery import page as discovery_page
from adaptive_flot.runner.commands.runs import run_files
from tests.cli.conftest import Call, WriteTable
from tests.discovery.heated import tank_record

KEYS = {"verdict", "effects", "class", "error", "tests", "parameters", "drift", "absorbed", "notes", "seconds"}


def test_a_record_that_says_too_little_gets_a_verdict_a_report_and_no_model(
    call: Call, table: WriteTable, tmp_path: Path
) -> None:
    """150 rows: `insufficient`, with the reason, exit code 0."""
    result = call("discover", table(), "--json", "copy.json", "--out", "r", "--save-model", "m.yaml")
    assert result.code == 0, result.err
    assert result.out.startswith("insufficient: ") and "usable samples" in result.out
    text = (tmp_path / "r" / "verdict.json").read_text()
    assert text == (tmp_path / "copy.json").read_text()
    verdict = json.loads(text, parse_constant=lambda word: pytest.fail(word))
    assert verdict["verdict"] == "insufficient" and KEYS <= set(verdict) and verdict["effects"] == []
    page = (tmp_path / "r" / "report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html") and "usable samples" in page
    assert not (tmp_path / "m.yaml").exists() and "nothing was fitted" in result.out


def test_without_a_page_the_verdict_is_the_same(call: Call, table: WriteTable, tmp_path: Path) -> None:
    assert call("discover", table(), "--out", "with").code == 0
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "report.html").write_text("of an earlier verdict")
    result = call("discover", table(), "--out", "without", "--no-report")
    assert result.code == 0 and "report" not in result.out.lower()
    assert {f.name for f in (tmp_path / "without").iterdir()} == {"verdict.json"}
    one, other = (json.loads((tmp_path / k / "verdict.json").read_text()) for k in ("with", "without"))
    assert {**one, "seconds": 0} == {**other, "seconds": 0}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--model", "flottation"], "flotation"),
        (["--cell", "nowhere.yaml"], "nowhere.yaml"),
        (["--save-model", "model.json"], ".yaml"),
        (["--processes", "0"], "--processes"),
        (["--model", "cascaded-tanks"], "pump_voltage"),
    ],
)
def test_a_mistake_is_told_before_the_search_and_writes_nothing(
    call: Call, table: WriteTable, tmp_path: Path, more: list[str], says: str
) -> None:
    result = call("discover", table(), *more)
    assert result.code == 2 and says in result.err and result.out == "" and "Traceback" not in result.err
    assert {f.name for f in tmp_path.rglob("*") if f.is_file()} == {"record.csv"}


@pytest.mark.parametrize(
    ("column", "value", "says"),
    [("air_flow_m3_s", "", "air_flow_m3_s"), ("feed_flow_m3_s", "much", "feed_flow_m3_s"), ("time_s", 7.5, "increase")],
)
def test_a_record_that_can_not_be_read_is_one_line(
    call: Call, table: WriteTable, column: str, value: float | str, says: str
) -> None:
    def change(t: pd.DataFrame) -> pd.DataFrame:
        t[column] = t[column].astype(object)
        t.loc[20, column] = value
        return t

    result = call("discover", table(change))
    assert result.code == 2 and says in result.err and "record.csv" in result.err
    assert len(result.err.splitlines()) == 1


@pytest.mark.parametrize("limit", ["air_flow", "air_flow=1:", "air_flow=0.002:0.001", "air_flw=0.001:0.002"])
def test_a_limit_that_can_not_be_read_is_one_line(call: Call, table: WriteTable, limit: str) -> None:
    result = call("discover", table(), "--limit", limit)
    assert result.code == 2 and "limit" in result.err and "air_fl" in result.err and len(result.err.splitlines()) == 1


HEATED = """
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope


def equations(m: Scope) -> None:
    temperature = m.state("temperature")
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator")
    loss = m.site("heat_loss", m.parameter("loss") * (temperature - 293.0))
    m.derivative("temperature", (heating - loss) / 4.0e5)
    m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))


def make_model() -> Model:
    return Model(
        name="heated-tank",
        states=(Quantity("temperature", "K", "", 273.0, 373.0, 10.0),),
        inputs=(Quantity("power", "W", "", 0.0, 1e4), Quantity("fan_speed", "1/s", "", 0.0, 100.0)),
        parameters=(
            Parameter("efficiency", 0.9, "-", "data sheet", lower=0.5, upper=1.0, scale=0.05, role="estimated"),
            Parameter("loss", 80.0, "W/K", "guess", lower=1.0, upper=1000.0, scale=10.0, role="estimated"),
        ),
        outputs=(Quantity("temperature", "K", ""),),
        equations=equations,
        max_step_s=60.0,
        initial_guess={"temperature": 310.0},
    )
"""


def write_tank(folder: Path, name: str = "tank.csv", **more: Any) -> pd.DataFrame:
    (folder / "heated.py").write_text(HEATED)
    record = tank_record(**more)
    columns = {"time_s": record.time, "power_W": record.inputs[:, 0], "fan_speed_1_s": record.inputs[:, 1]}
    table = pd.DataFrame(columns | {"temperature_K": record.outputs[:, 0]})
    table.to_csv(folder / name, index=False)
    return table


def test_a_model_of_the_user_from_record_to_extended_model(call: Call, tmp_path: Path) -> None:
    """Record in; verdict, page and model file out; the model file is accepted by discover, estimate and simulate."""
    write_tank(tmp_path)
    result = call(
        "discover", "tank.csv", "--model", "heated:make_model", "--processes", "1", "--save-model", "more.yaml"
    )
    assert result.code == 0, result.err
    said = " ".join(result.out.split())
    assert said.startswith("named: Heat loss depends on fan speed: ")
    assert "temperature" in said and "Model: more.yaml" in said
    page = (tmp_path / "results" / "tank" / "discover" / "report.html").read_text()
    assert "heat loss by fan speed" in page and "Error before and after" in page
    verdict = json.loads((tmp_path / "results" / "tank" / "discover" / "verdict.json").read_text())
    assert verdict["effects"][0]["site"] == "heat_loss"
    assert verdict["error"]["temperature"]["after"] < 0.2 * verdict["error"]["temperature"]["before"]

    write_tank(tmp_path, "fresh.csv", seed=5)
    again = call("discover", "fresh.csv", "--model", "more.yaml", "--processes", "1")
    assert again.code == 0 and again.out.startswith("none: ")
    replayed = call("estimate", "fresh.csv", "--model", "more.yaml", "--estimator", "fixed", "--json", "e.json")
    assert replayed.code == 0, replayed.err
    assert call("simulate", "fresh.csv", "--model", "more.yaml", "--out", "s.csv").code == 0


def _drop(t: pd.DataFrame) -> pd.DataFrame:
    return t.drop(columns="fan_speed_1_s")


def _uneven(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(time_s=t["time_s"] + np.where(t.index == 200, 0.3 * (t["time_s"][1] - t["time_s"][0]), 0.0))


def _still(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(power_W=1500.0, fan_speed_1_s=10.0)


def _no_output(t: pd.DataFrame) -> pd.DataFrame:
    return t.drop(columns="temperature_K")


def _range(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(power_W=1000 * t["power_W"])


@pytest.mark.parametrize(
    ("change", "code", "says"),
    [
        (_drop, 2, "fan_speed_1_s"),
        (_uneven, 2, "not uniform"),
        (_range, 2, "power"),
        (_still, 0, "insufficient: "),
        (_no_output, 2, "temperature_K"),
    ],
)
def test_a_bad_record_gets_an_error_or_a_verdict_that_names_the_reason(
    call: Call, tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame], code: int, says: str
) -> None:
    change(write_tank(tmp_path)).to_csv(tmp_path / "tank.csv", index=False)
    result = call("discover", "tank.csv", "--model", "heated:make_model", "--processes", "1")
    assert result.code == code and says in " ".join((result.out if code == 0 else result.err).split())
    assert (tmp_path / "results").exists() == (code == 0)


@pytest.mark.parametrize("end", ["SIGINT", "SIGTERM"])
def test_who_ends_it_while_the_page_is_drawn_gets_no_verdict_without_its_page(
    call: Call, table: WriteTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    monkeypatch.setattr(discovery_page, "discovery_report", lambda *_: os.kill(os.getpid(), signal.Signals[end]))
    assert call("discover", table(), "--out", "r").code == {"SIGINT": 130, "SIGTERM": 143}[end]
    assert not (tmp_path / "r").exists()


def test_who_ends_it_while_files_are_written_gets_them_all(
    call: Call, table: WriteTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = run_files.write_json

    def interrupted(path: Path, content: object) -> None:
        write(path, content)
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(run_files, "write_json", interrupted)
    assert call("discover", table(), "--out", "r").code == 143
    assert {f.name for f in (tmp_path / "r").iterdir()} == {"verdict.json", "report.html"}
