"""What a result writes is checked before any work, as the commands do: nothing that was read is lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import yaml

import adaptive_flot as af
from adaptive_flot.api.estimation import Estimation
from adaptive_flot.api.finding import Finding
from adaptive_flot.api.runs import Runs
from adaptive_flot.api.simulation import Simulation
from adaptive_flot.errors import OutputError
from adaptive_flot.report.kit.album import Album
from adaptive_flot.resources import cell_file
from tests.runner.conftest import edited

Write = Callable[[Path], object]


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hundred seconds of the cell, too short for a search."""
    inputs = pd.DataFrame({"time_s": range(100), "air_flow_m3_s": 1.2e-3, "level_setpoint_m": 0.4})
    inputs["feed_flow_m3_s"] = [1.7e-4 if k % 40 < 20 else 2.0e-4 for k in range(100)]
    folder = tmp_path_factory.mktemp("record")
    (folder / "cell.yaml").write_bytes(cell_file().read_bytes())
    af.simulate("lab_87l", inputs).save(folder / "record.csv")
    return folder / "record.csv"


@pytest.fixture(scope="module")
def results(record: Path) -> tuple[Simulation, Estimation, Finding]:
    cell = record.parent / "cell.yaml"
    fit = af.estimate(cell, record, estimators=["fixed"], parameters=["C"], outputs=["concentrate_grade"])
    return af.simulate(cell, record), fit, af.discover(cell, record)


@pytest.fixture
def writers(results: tuple[Simulation, Estimation, Finding]) -> dict[str, Write]:
    simulation, fit, finding = results
    return {
        "save": simulation.save,
        "report": fit.report,
        "save of a fit": fit.save,
        "save_cell": fit.save_cell,
        "report of a finding": finding.report,
    }


@pytest.mark.parametrize("name", ["record.csv", "cell.yaml", "folder"])
@pytest.mark.parametrize("writer", ["save", "report", "save of a fit", "save_cell", "report of a finding"])
def test_what_was_read_and_what_can_not_be_written_is_refused_before_any_work(
    writers: dict[str, Write], record: Path, writer: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Album, "add", lambda *_: pytest.fail("a picture was drawn"))
    (record.parent / "folder").mkdir(exist_ok=True)
    before = {f: f.read_bytes() for f in record.parent.iterdir() if f.is_file()}
    with pytest.raises(OutputError, match="is a folder" if name == "folder" else "would be lost") as caught:
        writers[writer](record.parent / name)
    assert str(caught.value).startswith(f"{writer.split()[0]}: ")
    assert {f: f.read_bytes() for f in record.parent.iterdir() if f.is_file()} == before


def test_runs_are_written_all_or_none(tmp_path: Path) -> None:
    """The last file can not be written: no other is there either, and the scenario is not overwritten."""
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump(edited({}), sort_keys=False))
    runs: Runs = af.run(file, estimators="fixed", seeds=[1])
    (tmp_path / "out" / "summary.json").mkdir(parents=True)
    with pytest.raises(OutputError, match="is a folder"):
        runs.save(tmp_path / "out")
    assert list((tmp_path / "out").glob("*.csv")) == []
    with pytest.raises(OutputError, match="would be lost"):
        runs.report(file)
