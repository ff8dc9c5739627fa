"""Short scenarios in a temporary folder, and one that has been run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.edits import edit

DURATION, INITIAL = 120, 40
CONTENT = f"""
description: Two minutes of the cell
duration_s: {DURATION}
seeds: [1, 2]
inputs:
  air_flow_m3_s: {{profile: staircase, from: 9.05e-4, to: 2.17e-3, every_s: 20}}
  feed_flow_m3_s: {{profile: constant, value: 1.67e-4}}
  level_setpoint_m: {{profile: random, between: [0.33, 0.42], every_s: 30, seed: per_run}}
parameters:
  C: {{profile: ramp, change: 0.20, from_s: 50, to_s: 90}}
measurements:
  concentrate_grade: {{noise_std: 1.0e-3}}
  level: {{noise_std: 2.0e-3}}
adapt: {{parameters: [n, C], outputs: [concentrate_grade]}}
initial_estimate: {{method: pem, until_s: {INITIAL}, guess: {{n: 1.1, C: 5.5e-4}}}}
estimators:
  fixed: {{use: fixed, start: nominal}}
  rpem: {{use: rpem, options: {{forgetting: 0.98}}}}
fits_after_s: 60
"""

WriteScenario = Callable[..., Path]


def edited(changes: Mapping[str, Any]) -> dict[str, Any]:
    """The short scenario with entries changed by dotted path; `...` deletes, a new path adds."""
    return edit(yaml.safe_load(CONTENT), changes)


@pytest.fixture
def write_scenario(tmp_path: Path) -> WriteScenario:
    """Write the short scenario as `short.yaml`, with changes by dotted path."""

    def write(changes: Mapping[str, Any] | None = None) -> Path:
        file = tmp_path / "short.yaml"
        file.write_text(yaml.safe_dump(edited(changes or {}), sort_keys=False))
        return file

    return write


@pytest.fixture(scope="session")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """The short scenario."""
    file = tmp_path_factory.mktemp("scenario") / "short.yaml"
    file.write_text(CONTENT)
    return load_scenario(file)


@pytest.fixture(scope="session")
def runs(scenario: Scenario) -> list[Run]:
    """The short scenario run: fixed and rpem, seeds 1 and 2."""
    return run_scenario(scenario)


@pytest.fixture(autouse=True)
def own_import_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders that a test's plug-ins put on the import path are gone after it."""
    monkeypatch.setattr(sys, "path", sys.path[:])
