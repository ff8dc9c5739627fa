"""A short scenario whose estimator and controller cost little, with its certificates and its link file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import yaml

from adaptive_flot.live.certificates import make_certificates
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import Link, load_link
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.edits import edit
from tests.live.bench import INITIAL, Bench, Distort, as_told

CONTENT = f"""
description: Ten hours of the cell under a controller that costs little
duration_s: 36000
seeds: [1]
inputs:
  air_flow_m3_s: {{profile: steps, at_s: [0, 4, 8], values: [1.4e-3, 1.6e-3, 1.5e-3]}}
  feed_flow_m3_s: {{profile: constant, value: 1.67e-4}}
  level_setpoint_m: {{profile: constant, value: 0.39}}
measurements:
  concentrate_grade: {{noise_std: 1.0e-3}}
  level: {{noise_std: 5.0e-4}}
adapt: {{parameters: [n, C], outputs: [concentrate_grade]}}
initial_estimate: {{method: pem, until_s: {INITIAL}, guess: {{n: 1.0, C: 6.0e-4}}}}
estimators:
  rpem: {{use: rpem, options: {{forgetting: 0.98}}}}
controllers:
  pi: {{use: pi}}
  hold: {{use: hold}}
limits:
  concentrate_grade: 0.20
  level_m: [0.33, 0.42]
  inputs: {{air_flow_m3_s: [9.05e-4, 2.17e-3], level_setpoint_m: [0.33, 0.42]}}
  largest_move: {{air_flow_m3_s: 2.0e-5, level_setpoint_m: 0.01}}
economics: {{metal_per_kg: 2.5, treatment_per_kg: 0.10, air_per_m3: 1.0e-3, reagent_per_m3: 0.05}}
"""


@pytest.fixture(scope="session")
def write_live_scenario(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Mapping[str, object]], Scenario]:
    """The scenario with keys changed by dotted path."""

    def write(changes: Mapping[str, object]) -> Scenario:
        file = tmp_path_factory.mktemp("live") / "short_live.yaml"
        file.write_text(yaml.safe_dump(edit(yaml.safe_load(CONTENT), changes)))
        return load_scenario(file)

    return write


@pytest.fixture(scope="session")
def scenario(write_live_scenario: Callable[[Mapping[str, object]], Scenario]) -> Scenario:
    """The short scenario as it is."""
    return write_live_scenario({})


@pytest.fixture(scope="session")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with certificates, keys and passwords."""
    folder = tmp_path_factory.mktemp("certificates")
    make_certificates(folder)
    return folder


@pytest.fixture(scope="session")
def write_link(certificates: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Link]:
    """Write and read the link file of a scenario, with keys changed by dotted path."""

    def write(
        scenario: Scenario, changes: Mapping[str, object] | None = None, *, port: int = 4840, speed: float = 20
    ) -> Link:
        text = link_text(scenario, f"opc.tcp://127.0.0.1:{port}/adaptive-flot", certificates, speed=speed)
        content = edit(yaml.safe_load(text), {"scenario": str(scenario.path), **(changes or {})})
        file = tmp_path_factory.mktemp("link") / "link.yaml"
        file.write_text(yaml.safe_dump(content))
        return load_link(file)

    return write


@pytest.fixture(scope="session")
def link(write_link: Callable[..., Link], scenario: Scenario) -> Link:
    """Link of the short scenario, with the controller that costs little."""
    return write_link(scenario, {"controller": "pi"})


@pytest.fixture(scope="session")
def cycle(link: Link) -> Cycle:
    """Estimator and controller of the link, built once: nothing in them changes."""
    return Cycle(link)


@pytest.fixture(scope="session")
def at_closed(cycle: Cycle) -> Callable[..., Bench]:
    """A bench that has just gone to closed, with an instrument fault where one is given; its start is run once."""
    first = Bench(cycle)
    first.to_closed()

    def make(distort: Distort = as_told) -> Bench:
        return first.copy(distort)

    return make
