"""`run --record EXPORT --map MAP`: a scenario under the inputs of a plant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot import load_scenario, run
from tests.cli.conftest import Call, WriteScenario
from tests.cli.records.test_import import MAP
from tests.records.exports import Plant, text

SHORT = {"duration_s": 200, "initial_estimate.until_s": 100, "fits_after_s": 100}


@pytest.fixture
def export(tmp_path: Path) -> Path:
    """An export with its map, and the record that `import` would make of them."""
    (tmp_path / "export.csv").write_text(text(Plant().columns()))
    (tmp_path / "map.yaml").write_text(MAP)
    return tmp_path / "export.csv"


def test_export_with_map_and_record_are_the_same_run(call: Call, scenario: WriteScenario, export: Path) -> None:
    """The inputs that act are those of the plant; page and console say whose they are."""
    file = scenario(SHORT)
    assert call("import", export, "--map", "map.yaml", "--out", "record.csv", "--no-report").code == 0
    options = ["--estimator", "fixed", "--controller", "schedule"]
    first = call("run", file, "--record", export, "--map", "map.yaml", "--out", "a", *options)
    second = call("run", file, "--record", "record.csv", "--out", "b", *options)
    assert (first.code, second.code) == (0, 0), first.err + second.err
    assert "Inputs of export.csv, 59 rows, one every 10 s" in first.out
    one, other = [pd.read_csv(Path(out) / "fixed_schedule_seed1.csv") for out in "ab"]
    pd.testing.assert_frame_equal(one, other)
    assert np.allclose(one["air_flow_m3_s"], np.repeat(Plant().air[1:-1], 10), rtol=1e-9)
    page = Path("a/report.html").read_text()
    assert "Inputs of a record (air flow, feed flow and level setpoint): export.csv" in page
    assert "SHA-256 of export.csv" in page and "SHA-256 of map.yaml" in page


def test_from_python_it_is_the_same_run(call: Call, scenario: WriteScenario, export: Path) -> None:
    file = scenario(SHORT)
    options = ["--estimator", "fixed", "--controller", "schedule", "--out", "a"]
    assert call("run", file, "--record", export, "--map", "map.yaml", *options).code == 0
    found = run(load_scenario(file), estimators="fixed", controllers="schedule", record=export, tag_map="map.yaml")
    told = pd.read_csv("a/fixed_schedule_seed1.csv")
    assert np.allclose(found.runs[0].table["level_m_true"], told["level_m_true"], rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--map", "map.yaml"], "--map: there is no --record that it belongs to"),
        (["--record", "export.csv"], "column 'time_s' is missing; add it"),
        (["--record", "nowhere.csv"], "nowhere.csv: no such file"),
        (["--record", "export.csv", "--map", "map.yaml", "--json", "export.csv"], "is an input"),
        (["--record", "export.csv", "--map", "map.yaml", "--json", "map.yaml"], "is an input"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(
    call: Call, scenario: WriteScenario, export: Path, arguments: list[str], said: str
) -> None:
    file = scenario(SHORT)
    before = {f: f.read_bytes() for f in export.parent.iterdir()}
    result = call("run", file, *arguments)
    assert result.code == 2 and said in result.err and len(result.err.splitlines()) == 1
    assert {f: f.read_bytes() for f in export.parent.iterdir()} == before
