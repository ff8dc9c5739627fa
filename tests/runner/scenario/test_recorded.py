"""Inputs of a record in a scenario: held as they acted, known by their values, refused where they do not fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.errors import AdaptiveFlotError, ScenarioError
from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.recorded_inputs import on_record
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.studies.grid import scenario_hash
from adaptive_flot.targets import scenario_inputs
from tests.records.exports import Plant
from tests.runner.conftest import edited

STEP = 10.0
SHORT = {"duration_s": 400, "initial_estimate.until_s": 100, "fits_after_s": 100, "seeds": [1]}
RECORDED = {"profile": "record", "file": "plant.csv"}


def record(**columns: Any) -> pd.DataFrame:
    """What the plant of the exports did, as a record."""
    table = Plant().truth().reset_index(drop=True).assign(**columns)
    table.insert(0, "time_s", STEP * np.arange(len(table)))
    return table


def scenario(folder: Path, changes: dict[str, Any]) -> Scenario:
    (folder / "short.yaml").write_text(yaml.safe_dump(edited({**SHORT, **changes}), sort_keys=False))
    return load_scenario(folder / "short.yaml")


@pytest.fixture
def read(model: Model) -> Dataset:
    return read_dataset(record(), model)


def test_a_row_of_the_record_is_held_in_each_of_its_intervals(tmp_path: Path) -> None:
    """The first interval has the inputs of the second row: those of the first acted before the record."""
    record().to_csv(tmp_path / "plant.csv", index=False)
    found = scenario(tmp_path, {"inputs.air_flow_m3_s": RECORDED})
    air = Realisation(found, 1).schedule[:, 0]
    assert np.array_equal(air, np.repeat(Plant().air[1:-1], 10)[: len(air)])
    assert list(found.recorded) == ["air_flow_m3_s"]
    assert tmp_path / "plant.csv" in scenario_inputs(found)


def test_several_rows_in_an_interval_are_averaged(model: Model, tmp_path: Path) -> None:
    slow = scenario(tmp_path, {"sampling_s": 20})
    found = on_record(slow, read_dataset(record(), model), Path("plant.csv"))
    air = Realisation(found, 1).schedule[:, 0]
    assert np.allclose(air, Plant().air[1:-1][: 2 * len(air)].reshape(-1, 2).mean(axis=1), rtol=1e-12)
    assert np.unique(air).size == 3


def test_a_scenario_on_a_record_has_all_its_inputs_and_its_length(tmp_path: Path, read: Dataset) -> None:
    found = on_record(scenario(tmp_path, {}), read, Path("plant.csv"))
    assert found.file.duration_s == (len(read) - 1) * STEP
    schedule = Realisation(found, 1).schedule
    assert np.array_equal(schedule, np.repeat(read.inputs[1:], 10, axis=0))


def test_runs_are_the_same_where_the_values_are_and_not_the_file(tmp_path: Path, read: Dataset) -> None:
    """Results of two records are never taken for runs of one."""
    plain = scenario(tmp_path, {})
    one, moved = on_record(plain, read, Path("a.csv")), on_record(plain, read, Path("elsewhere/b.csv"))
    other = on_record(plain, replace(read, inputs=1.01 * read.inputs), Path("a.csv"))
    for of in (conditions, scenario_hash):
        assert of(one) == of(moved)
        assert len({of(one), of(other), of(plain)}) == 3


@pytest.mark.parametrize(
    ("changes", "columns", "said"),
    [
        ({"duration_s": 3000}, {}, r"duration_s = 3000 is longer than plant.csv, of which 580 s can be played"),
        ({"sampling_s": 4}, {}, "sampling_s = 4 does not fit plant.csv, with a row every 10 s"),
        ({}, {"air_flow_m3_s": 90.0}, "air_flow_m3_s"),
        ({"inputs.air_flow_m3_s": {**RECORDED, "file": "plnat.csv"}}, {}, "plnat.csv: no such file"),
        ({"inputs.air_flow_m3_s": {**RECORDED, "map": "m.yaml"}}, {}, "m.yaml: can not be read"),
        ({"inputs.air_flow_m3_s": {"profile": "record"}}, {}, "file' is missing"),
    ],
)
def test_a_record_that_does_not_fit_is_one_line(
    tmp_path: Path, changes: dict[str, Any], columns: dict[str, float], said: str
) -> None:
    record(**columns).to_csv(tmp_path / "plant.csv", index=False)
    with pytest.raises(AdaptiveFlotError, match=said) as caught:
        scenario(tmp_path, {"inputs.air_flow_m3_s": RECORDED, **changes})
    assert len(str(caught.value).splitlines()) == 1


def test_a_record_shorter_than_the_initial_estimate_is_refused(tmp_path: Path, read: Dataset) -> None:
    with pytest.raises(ScenarioError, match=r"plant.csv: initial_estimate.until_s = 100 s must .* before the end"):
        on_record(scenario(tmp_path, {}), read.rows(0, 8), Path("plant.csv"))
