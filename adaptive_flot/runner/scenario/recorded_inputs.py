"""Scenarios whose inputs are those of a measured record: read it, and put a scenario on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from adaptive_flot.errors import located
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.registry import read_measurements
from adaptive_flot.records.tag_map import load_tag_map
from adaptive_flot.runner.scenario.checks import check_scenario
from adaptive_flot.runner.scenario.inputs.profiles import InputProfile
from adaptive_flot.runner.scenario.inputs.recorded import Recorded, beside
from adaptive_flot.runner.scenario.scenario import Scenario


def with_values(inputs: Mapping[str, InputProfile], model: Model, folder: Path) -> dict[str, InputProfile]:
    """Profiles of inputs, those of records with their values; each file is read once.

    Parameters
    ----------
    inputs
        By column.
    model
        Names, units and ranges.
    folder
        That of the scenario.

    Raises
    ------
    DataError, RangeError
        A record or a map can not be used.
    """
    read: dict[tuple[str, str | None], Dataset] = {}
    columns = [q.column for q in model.inputs]
    found = dict(inputs)
    for column, profile in inputs.items():
        if not isinstance(profile, Recorded) or column not in columns:
            continue
        key = profile.file, profile.map
        if key not in read:
            with located(f"inputs.{column}"):
                tag_map = None if profile.map is None else load_tag_map(beside(folder, profile.map))
                read[key] = read_measurements(beside(folder, profile.file), model, tag_map=tag_map).record
        found[column] = profile.of(read[key], columns.index(column))
    return found


def on_record(scenario: Scenario, record: Dataset, file: Path, tag_map: Path | None = None) -> Scenario:
    """A scenario with all inputs of a record in place of its own; it lasts as long as the record.

    Parameters
    ----------
    scenario
        The scenario. Its sampling interval stays: a row of the record is held, or several are averaged.
    record
        The record, of the scenario's model.
    file, tag_map
        Where it comes from: no result may overwrite it, and reports name it.

    Raises
    ------
    ScenarioError
        The record is too short, or its rows do not fit the sampling interval.
    RangeError
        An input leaves the model's range.
    """
    played = Recorded(profile="record", file=str(file), map=None if tag_map is None else str(tag_map))
    inputs = {q.column: played.of(record, j) for j, q in enumerate(scenario.model.inputs)}
    span, dt = (len(record) - 1) * record.dt, scenario.dt
    changed = {"inputs": inputs, "duration_s": dt * float(np.floor(span / dt + 1e-6))}
    found = replace(scenario, file=scenario.file.model_copy(update=changed))
    with located(file.name):
        check_scenario(found)
    return found
