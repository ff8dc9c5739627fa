"""The table of a run: one row an interval, and the fits that are taken from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot import metrics
from adaptive_flot.contracts import Setup, Status
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.results.run_arrays import RunArrays
from adaptive_flot.runner.scenario.scenario import Scenario

SOFTENED = "softened_"
"""Begin of the columns that say how far a plan goes beyond a limit; the name of the quantity follows."""
_NAMES = {id(status): status.name.lower() for status in Status}
"""Names in the tables by the identity of each status: its own hash and name cost a call for every row."""


@dataclass(frozen=True)
class TimeSeries:
    """What is shown of a run, and measured by: its arrays with the names that they have in tables.

    Attributes
    ----------
    scenario
        The scenario.
    run
        What the run left behind.
    setup
        What its estimator was built for.
    """

    scenario: Scenario
    run: RunArrays
    setup: Setup

    def table(self) -> pd.DataFrame:
        """One row an interval: `time_s`, inputs, and columns with suffixes.

        Suffixes, by kind of quantity:

        - inputs: `_true` where what acted is not what was known;
        - outputs: `_true`, `_measured`, `_predicted`, `_innovation`, `_innovation_std`;
        - adapted parameters: `_true`, `_estimate`, `_std`, and for each pair of them `_correlation` (as
          `n_C_correlation`), as the estimator claims them;
        - other parameters that move or are measured: `_true`, `_known`; NaN where the plant, or the estimator's model,
          has no such parameter.

        Then follow `status` of the estimator, `control_status` and `decided_by`. `faults` are there where a scenario
        has any. `control_message` says which constraints were in the way where an optimisation failed, and which limits
        were given up where no plan keeps all. `softened_<name>` is how far the plan goes beyond that limit, in the unit
        of the output, state or input; NaN where it is kept. `solve_seconds` is how long the optimisation took.
        """
        scenario, run = self.scenario, self.run
        columns: dict[str, Any] = {"time_s": run.time}
        columns |= _inputs(scenario, run) | _outputs(scenario, run) | _adapted(scenario, run, self.setup)
        columns |= _others(scenario, run, self.setup)
        columns["status"] = [_NAMES[id(status)] for status in run.statuses]
        columns["control_status"] = [_NAMES[id(status)] for status in run.control_statuses]
        columns["decided_by"] = list(run.decided_by)
        if scenario.file.faults:
            columns["faults"] = ["; ".join(names) for names in run.faults]
        if any(run.messages):
            columns["control_message"] = list(run.messages)
        for name in dict.fromkeys(name for softened in run.softened for name in softened):
            columns[f"{SOFTENED}{name}"] = [softened.get(name, np.nan) for softened in run.softened]
        if np.isfinite(run.solve_seconds).any():
            columns["solve_seconds"] = run.solve_seconds
        return pd.DataFrame(columns)

    def fits(self) -> dict[str, float]:
        """Fits as the paper defines them: adapted parameters, then driving outputs, over t > `fits_after_s`."""
        scenario, run, model = self.scenario, self.run, self.scenario.model
        accounted = run.time > scenario.fits_after + 1e-9
        quality = {}
        for name in scenario.setup.parameters:
            label = model.parameters[model.index("parameters", name)].label
            true = _column(run.parameters, scenario.plant_model.names("parameters"), name)
            found = _column(run.estimates, self.setup.parameters, name)
            quality[label] = metrics.fit(true[accounted], found[accounted])
        for name, j in zip(scenario.setup.outputs, model.indices("outputs", scenario.setup.outputs), strict=True):
            quality[name] = metrics.fit(run.true[accounted, j], run.prediction[accounted, j])
        return quality

    def status_counts(self) -> dict[str, int]:
        """How often the estimator returned which status."""
        return {_NAMES[key]: count for key, count in Counter(map(id, self.run.statuses)).items()}


def _inputs(scenario: Scenario, run: RunArrays) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for j, q in enumerate(scenario.model.inputs):
        columns[q.column] = run.inputs[:, j]
        if not np.array_equal(run.inputs[:, j], run.acted[:, j]):
            columns[f"{q.column}_true"] = run.acted[:, j]
    return columns


def _outputs(scenario: Scenario, run: RunArrays) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for j, q in enumerate(scenario.model.outputs):
        columns[f"{q.column}_true"] = run.true[:, j]
        columns[f"{q.column}_predicted"] = run.prediction[:, j]
        if np.isfinite(run.measured[:, j]).any():
            columns[f"{q.column}_measured"] = run.measured[:, j]
            columns[f"{q.column}_innovation"] = run.innovation[:, j]
        if q.name in scenario.setup.outputs:
            columns[f"{q.column}_innovation_std"] = run.innovation_std[:, scenario.setup.outputs.index(q.name)]
    return columns


def _adapted(scenario: Scenario, run: RunArrays, setup: Setup) -> dict[str, Any]:
    model, plant = scenario.model, scenario.plant_model.names("parameters")
    columns: dict[str, Any] = {}
    with np.errstate(invalid="ignore"):  # a variance that rounding has made negative says nothing: NaN
        std = np.sqrt(np.diagonal(run.covariance, axis1=1, axis2=2))
    for name in scenario.setup.parameters:
        label = model.parameters[model.index("parameters", name)].label
        columns[f"{label}_true"] = _column(run.parameters, plant, name)
        columns[f"{label}_estimate"] = _column(run.estimates, setup.parameters, name)
        columns[f"{label}_std"] = _column(std, setup.parameters, name)
    for a, b in combinations(scenario.setup.parameters, 2):
        columns[correlation_column(model, a, b)] = _correlation(run.covariance, setup.parameters, a, b)
    return columns


def correlation_column(model: Model, first: str, second: str) -> str:
    """Column of the correlation that an estimator claims of two parameters, each by its full name."""
    labels = [model.parameters[i].label for i in model.indices("parameters", [first, second])]
    return f"{labels[0]}_{labels[1]}_correlation"


def _correlation(P: FloatArray, names: Sequence[str], first: str, second: str) -> FloatArray:
    if first not in names or second not in names:
        return np.full(len(P), np.nan)
    i, j = names.index(first), names.index(second)
    spread = np.sqrt(P[:, i, i] * P[:, j, j])
    correlation: FloatArray = np.divide(P[:, i, j], spread, out=np.full(len(P), np.nan), where=spread > 0)
    return correlation


def _column(table: FloatArray, names: Sequence[str], name: str) -> FloatArray:
    return table[:, names.index(name)] if name in names else np.full(len(table), np.nan)


def _others(scenario: Scenario, run: RunArrays, setup: Setup) -> dict[str, Any]:
    """Parameters that are not adapted but move in the plant, or are measured."""
    plant, model = scenario.plant_model, setup.model
    measured = [scenario.model.parameters[i] for i in scenario.measured_parameters]
    moved = [plant.parameters[plant.index("parameters", name)] for name, _ in scenario.moving_parameters]
    known = np.full((len(run.time), len(model.parameters)), np.nan) if run.known is None else run.known
    columns: dict[str, Any] = {}
    for p in dict.fromkeys((*moved, *measured)):
        if p.name not in scenario.setup.parameters:
            columns[f"{p.label}_true"] = _column(run.parameters, plant.names("parameters"), p.name)
        if p in measured:
            columns[f"{p.label}_known"] = _column(known, model.names("parameters"), p.name)
    return columns
