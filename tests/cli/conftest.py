"""The command line called in this process, in an empty folder, with small inputs to give it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml

from adaptive_flot import cli
from adaptive_flot.greybox.model import Model
from tests.runner.conftest import edited
from tests.runner.records import PlantRecord, plant_record

SHORT = {"duration_s": 60, "initial_estimate.until_s": 30, "fits_after_s": 30, "seeds": [1]}


@dataclass(frozen=True)
class Result:
    """Exit code and what was printed."""

    code: int
    out: str
    err: str


Call = Callable[..., Result]
WriteScenario = Callable[..., Path]
WriteTable = Callable[..., Path]


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Call:
    """Run `adaptive-flot ...` in a temporary folder; everything printed is caught, CasADi's messages too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])

    def run(*arguments: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["adaptive-flot", *map(str, arguments)])
        capfd.readouterr()
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        return Result(code, *capfd.readouterr())

    return run


@pytest.fixture
def scenario(tmp_path: Path) -> WriteScenario:
    """Write a scenario of one minute, `short.yaml`, with changes by dotted path."""

    def write(changes: Mapping[str, Any] | None = None) -> Path:
        file = tmp_path / "short.yaml"
        file.write_text(yaml.safe_dump(edited({**SHORT, **(changes or {})}), sort_keys=False))
        return file

    return write


@pytest.fixture(scope="session")
def plant(model: Model) -> PlantRecord:
    """Two and a half minutes of the cell with known truth."""
    return plant_record(model, rows=150)


@pytest.fixture
def table(plant: PlantRecord, tmp_path: Path) -> WriteTable:
    """Write the measured record, `record.csv`, after a change of its table."""

    def write(change: Callable[[pd.DataFrame], pd.DataFrame | None] = lambda t: t) -> Path:
        changed = plant.table.copy()
        found = change(changed)
        file = tmp_path / "record.csv"
        (changed if found is None else found).to_csv(file, index=False)
        return file

    return write
