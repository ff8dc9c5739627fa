"""`adaptive-flot estimate`: summary, tables, report, and a cell file that goes back in."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.processes.flotation import read_cell
from adaptive_flot.resources import cell_file
from tests.cli.conftest import Call, WriteTable
from tests.runner.commands.test_innovations_form import record as plate_record
from tests.runner.loop.test_plugins import MODEL
from tests.runner.records import TRUTH, PlantRecord


def test_it_writes_summary_tables_and_report(call: Call, table: WriteTable, tmp_path: Path) -> None:
    result = call("estimate", table(), "--out", "r", "--json", "copy.json")
    assert result.code == 0, result.err
    names = {f.name for f in (tmp_path / "r").iterdir()}
    assert {"summary.json", "report.html", "fixed.csv", "adaptive_imm.csv", "pem.csv"} <= names
    assert not any(n.startswith(".") for n in names)
    text = (tmp_path / "r" / "summary.json").read_text()
    assert text == (tmp_path / "copy.json").read_text()
    summary = json.loads(text, parse_constant=lambda word: pytest.fail(word))
    assert summary["data"] == "record.csv"
    for p in summary["fit"]["parameters"]:
        assert abs(p["value"] - TRUTH[p["label"]]) < 4 * p["std"]
    page = (tmp_path / "r" / "report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html") and "adaptive-flot estimate" in page
    assert result.out.index("n = ") < result.out.index("Identifiability:") < result.out.index("root mean square errors")


def test_a_fitted_cell_goes_back_in_and_simulates_the_record(
    call: Call, table: WriteTable, plant: PlantRecord, tmp_path: Path
) -> None:
    """Save, simulate the inputs with it: the grade of the truth, far closer than with the nominal parameters."""
    file = table()
    assert call("estimate", file, "--estimator", "pem", "--save-cell", "fitted.yaml", "--out", "r").code == 0
    fitted = json.loads((tmp_path / "r" / "summary.json").read_text())["fit"]["parameters"]
    cell = read_cell(tmp_path / "fitted.yaml")
    for p in fitted:
        assert cell.value(p["name"]) == pytest.approx(p["value"], rel=1e-12)
    off = []
    for cell_name in ("fitted.yaml", "lab_87l"):
        assert call("simulate", file, "--cell", cell_name, "--out", "again.csv").code == 0
        again = pd.read_csv(tmp_path / "again.csv")["concentrate_grade"]
        off.append(float(np.abs(again - plant.truth["concentrate_grade"]).max()))
    assert off[0] < 0.25 * off[1]
    assert call("estimate", file, "--cell", "fitted.yaml", "--estimator", "fixed", "--out", "r2").code == 0


@pytest.mark.parametrize("fit", [["n"], ["coalescence_rate"], ["n", "C", "floatability"]])
def test_parameters_to_fit_can_be_chosen(call: Call, table: WriteTable, tmp_path: Path, fit: list[str]) -> None:
    """By symbol, by name and as a group; also a single one."""
    options = [word for name in fit for word in ("--fit", name)]
    result = call("estimate", table(), *options, "--out", "r")
    assert result.code == 0, result.err
    fitted = json.loads((tmp_path / "r" / "summary.json").read_text())["fit"]["parameters"]
    expected = {
        "n": ["growth_exponent"],
        "C": ["coalescence_rate"],
        "coalescence_rate": ["coalescence_rate"],
        "floatability": ["floatability.chalcopyrite", "floatability.quartz"],
    }
    assert [p["name"] for p in fitted] == [full for name in fit for full in expected[name]]


def test_estimators_outputs_and_share_can_be_chosen(call: Call, table: WriteTable, tmp_path: Path) -> None:
    """And a batch of records needs no page each."""
    options = ["--estimator", "rpem", "--output", "concentrate_grade", "--fit-share", "0.8", "--out", "r"]
    result = call("estimate", table(), *options, "--no-report")
    assert result.code == 0, result.err
    assert not (tmp_path / "r" / "report.html").exists() and "Report:" not in result.out
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert summary["fit"]["outputs"] == ["concentrate_grade"]
    assert [e["estimator"] for e in summary["estimators"]] == ["rpem"]
    assert (pd.read_csv(tmp_path / "r" / "rpem.csv")["block"] == "fit").sum() == 120


def test_an_own_model_beside_the_record(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process, from another folder than the current one; two states of knowledge, one command."""
    from tests.estimators import toys

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "cli_own_model.py").write_text(MODEL)
    generator = np.random.default_rng(0)
    data = toys.record(toys.decay(), np.repeat(generator.normal(size=30), 4), parameters={"a": 0.5, "b": 2.0})
    noisy = data.outputs[:, 0] + 0.05 * generator.normal(size=len(data))
    own = pd.DataFrame({"time_s": data.time, "u_V": data.inputs[:, 0], "y_V": noisy})
    own.to_csv(tmp_path / "mine" / "own.csv", index=False)
    result = call("estimate", "mine/own.csv", "--model", "cli_own_model:make_model", "--out", "r")
    monkeypatch.delitem(sys.modules, "cli_own_model")
    assert result.code == 0, result.err
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert summary["model"] == "mine"
    for p, truth in zip(summary["fit"]["parameters"], (0.5, 2.0), strict=True):
        assert abs(p["value"] - truth) < 4 * p["std"]


def test_a_cell_beside_the_record_is_used_and_saved(call: Call, plant: PlantRecord, tmp_path: Path) -> None:
    """`--cell` is looked for beside the record, for the fit and for the cell that is saved alike."""
    (tmp_path / "data").mkdir()
    plant.table.to_csv(tmp_path / "data" / "record.csv", index=False)
    (tmp_path / "data" / "own.yaml").write_text(cell_file().read_text().replace("6.38e-4", "6.00e-4"))
    options = ["--cell", "own.yaml", "--estimator", "pem", "--fit", "n", "--save-cell", "fitted.yaml", "--out", "r"]
    result = call("estimate", "data/record.csv", *options)
    assert result.code == 0, result.err
    assert yaml.safe_load((tmp_path / "fitted.yaml").read_text())["froth"]["coalescence_rate"]["value"] == 6.0e-4


def test_the_tanks_need_no_cell_and_save_none(call: Call, shared_file: Callable[[str], Path], tmp_path: Path) -> None:
    """Said before anything is read or written."""
    file = shared_file("data/cascaded-tanks/dataBenchmark.csv")
    result = call("estimate", file, "--model", "cascaded-tanks", "--save-cell", "fitted.yaml", "--out", "r")
    assert result.code == 2 and "--save-cell" in result.err and len(result.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_discovery_on_the_same_record_leaves_the_results_of_an_estimate(
    call: Call, table: WriteTable, tmp_path: Path
) -> None:
    """Each command has its own default folder: neither report overwrites the other."""
    file = table()
    assert call("estimate", file, "--estimator", "fixed").code == 0
    before = {f: f.read_bytes() for f in (tmp_path / "results").rglob("*") if f.is_file()}
    assert call("discover", file).code == 0
    assert {f.parent.name for f in before} == {"estimate"}
    assert all(f.read_bytes() == content for f, content in before.items())
    assert (tmp_path / "results" / "record" / "discover" / "report.html").is_file()


def test_a_record_with_process_noise_is_smoothed_into_a_file_and_onto_the_page(call: Call, tmp_path: Path) -> None:
    data = plate_record(0.3, seed=4)[0]
    rows = {"time_s": data.time, "power_W": data.inputs[:, 0], "thermometer_degC": data.outputs[:, 0]}
    pd.DataFrame(rows).to_csv(tmp_path / "plate.csv", index=False)
    (tmp_path / "plate.py").write_text("from tests.runner.commands.test_innovations_form import plate as make_model\n")
    result = call("estimate", "plate.csv", "--model", "plate.py:make_model", "--estimator", "pem", "--out", "r")
    assert result.code == 0, result.err
    assert "plate_degC_std" in (tmp_path / "r" / "smoothed.csv").read_text().splitlines()[0]
    assert "With process noise" in (tmp_path / "r" / "report.html").read_text() and "With process noise" in result.out
    assert json.loads((tmp_path / "r" / "summary.json").read_text())["innovations_form"]["errors"]
