"""The table of a run: one row an interval, and the fits that are taken from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd

from adaptive_flot import metrics
from adaptive_flot.contracts import Sample, Setup, Status
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.scenario.scenario import Scenario


def time_series(scenario: Scenario, steps: Sequence[Step], setup: Setup) -> pd.DataFrame:
    """Table of a run whose estimator was built for `setup`: `time_s`, inputs, and columns with suffixes.

    Suffixes, by kind of quantity:

    - inputs: `_true` where what acted is not what was known;
    - outputs: `_true`, `_measured`, `_predicted`, `_innovation`, `_innovation_std`;
    - adapted parameters: `_true`, `_estimate`, `_std`, and for each pair of them `_correlation` (as
      `n_C_correlation`), as the estimator claims them;
    - other parameters that move or are measured: `_true`, `_known`; NaN where the plant, or the estimator's model, has
      no such parameter.

    Then follow `status` of the estimator, `control_status` and `decided_by`. `faults` are there where a scenario has
    any. `control_message` says which constraints were in the way where an optimisation failed, and `solve_seconds` how
    long it took.
    """
    columns: dict[str, object] = {"time_s": [s.plant.sample.time for s in steps]}
    columns |= _inputs(scenario, steps) | _outputs(scenario, steps) | _adapted(scenario, steps, setup)
    columns |= _others(scenario, steps, setup)
    columns["status"] = [(s.estimate.status if s.estimate else Status.INITIALISING).name.lower() for s in steps]
    columns["control_status"] = [s.decision.status.name.lower() for s in steps]
    columns["decided_by"] = [s.decision.decided_by for s in steps]
    if scenario.file.faults:
        columns["faults"] = ["; ".join((*s.plant.faults, *s.decision.faults)) for s in steps]
    if any(s.decision.message for s in steps):
        columns["control_message"] = [s.decision.message for s in steps]
    solve = np.array([s.decision.solve_seconds for s in steps])
    if np.isfinite(solve).any():
        columns["solve_seconds"] = solve
    return pd.DataFrame(columns)


def _inputs(scenario: Scenario, steps: Sequence[Step]) -> dict[str, object]:
    known = np.array([s.plant.sample.inputs for s in steps])
    acted = np.array([s.plant.inputs for s in steps])
    columns: dict[str, object] = {}
    for j, q in enumerate(scenario.model.inputs):
        columns[q.column] = known[:, j]
        if not np.array_equal(known[:, j], acted[:, j]):
            columns[f"{q.column}_true"] = acted[:, j]
    return columns


def _outputs(scenario: Scenario, steps: Sequence[Step]) -> dict[str, object]:
    model, setup = scenario.model, scenario.setup
    estimates = [s.estimate for s in steps]
    columns: dict[str, object] = {}
    true = np.array([s.plant.outputs for s in steps])
    measured = np.array([s.outputs for s in in_time([s.plant.sample for s in steps], setup)])
    unknown = np.full(len(model.outputs), np.nan)
    predicted = np.array([e.prediction if e else unknown for e in estimates])
    innovation = np.array([s.outputs for s in in_time(innovations(steps), setup)])
    expected = np.array([e.innovation_std if e else np.full(len(setup.outputs), np.nan) for e in estimates])
    for j, q in enumerate(model.outputs):
        columns[f"{q.column}_true"] = true[:, j]
        columns[f"{q.column}_predicted"] = predicted[:, j]
        if np.isfinite(measured[:, j]).any():
            columns[f"{q.column}_measured"] = measured[:, j]
            columns[f"{q.column}_innovation"] = innovation[:, j]
        if q.name in setup.outputs:
            columns[f"{q.column}_innovation_std"] = expected[:, setup.outputs.index(q.name)]
    return columns


def innovations(steps: Sequence[Step]) -> list[Sample]:
    """Innovations in place of the measurements, those of delayed values with the sample that they arrived with."""
    unknown = np.full(len(steps[0].plant.outputs), np.nan)
    return [
        replace(s.plant.sample, outputs=s.estimate.innovation, delayed=s.estimate.delayed)
        if s.estimate
        else replace(s.plant.sample, outputs=unknown, delayed=())
        for s in steps
    ]


def _adapted(scenario: Scenario, steps: Sequence[Step], setup: Setup) -> dict[str, object]:
    model, plant = scenario.model, scenario.plant_model.names("parameters")
    estimates = [s.estimate for s in steps]
    columns: dict[str, object] = {}
    blank = np.full(len(setup.parameters), np.nan)
    true = np.array([s.plant.parameters for s in steps])
    theta = np.array([e.parameters if e else blank for e in estimates])
    with np.errstate(invalid="ignore"):  # a variance that rounding has made negative says nothing: NaN
        std = np.array([np.sqrt(np.diag(e.covariance)) if e else blank for e in estimates])
    for name in scenario.setup.parameters:
        label = model.parameters[model.index("parameters", name)].label
        columns[f"{label}_true"] = _column(true, plant, name)
        columns[f"{label}_estimate"] = _column(theta, setup.parameters, name)
        columns[f"{label}_std"] = _column(std, setup.parameters, name)
    for a, b in combinations(scenario.setup.parameters, 2):
        columns[correlation_column(model, a, b)] = _correlation(steps, setup.parameters, a, b)
    return columns


def correlation_column(model: Model, first: str, second: str) -> str:
    """Column of the correlation that an estimator claims of two parameters, each by its full name."""
    labels = [model.parameters[i].label for i in model.indices("parameters", [first, second])]
    return f"{labels[0]}_{labels[1]}_correlation"


def _correlation(steps: Sequence[Step], names: Sequence[str], first: str, second: str) -> FloatArray:
    if first not in names or second not in names:
        return np.full(len(steps), np.nan)
    i, j = names.index(first), names.index(second)
    unknown = np.full((len(names), len(names)), np.nan)
    P = np.array([s.estimate.covariance if s.estimate else unknown for s in steps])
    spread = np.sqrt(P[:, i, i] * P[:, j, j])
    correlation: FloatArray = np.divide(P[:, i, j], spread, out=np.full(len(P), np.nan), where=spread > 0)
    return correlation


def _column(table: FloatArray, names: Sequence[str], name: str) -> FloatArray:
    return table[:, names.index(name)] if name in names else np.full(len(table), np.nan)


def _others(scenario: Scenario, steps: Sequence[Step], setup: Setup) -> dict[str, object]:
    """Parameters that are not adapted but move in the plant, or are measured."""
    plant, model = scenario.plant_model, setup.model
    measured = [scenario.model.parameters[i] for i in scenario.measured_parameters]
    moved = [plant.parameters[plant.index("parameters", name)] for name, _ in scenario.moving_parameters]
    true = np.array([s.plant.parameters for s in steps])
    blank = np.full(len(model.parameters), np.nan)
    known = np.array([blank if s.plant.sample.parameters is None else s.plant.sample.parameters for s in steps])
    columns: dict[str, object] = {}
    for p in dict.fromkeys((*moved, *measured)):
        if p.name not in scenario.setup.parameters:
            columns[f"{p.label}_true"] = _column(true, plant.names("parameters"), p.name)
        if p in measured:
            columns[f"{p.label}_known"] = _column(known, model.names("parameters"), p.name)
    return columns


def fits(scenario: Scenario, table: pd.DataFrame) -> dict[str, float]:
    """Fits as the paper defines them: adapted parameters, then driving outputs, over t > `fits_after_s`."""
    accounted = table[table["time_s"] > scenario.fits_after + 1e-9]
    model, setup = scenario.model, scenario.setup
    labels = [model.parameters[i].label for i in model.indices("parameters", setup.parameters)]
    quality = {x: metrics.fit(accounted[f"{x}_true"].to_numpy(), accounted[f"{x}_estimate"].to_numpy()) for x in labels}
    for i in model.indices("outputs", setup.outputs):
        q = model.outputs[i]
        quality[q.name] = metrics.fit(
            accounted[f"{q.column}_true"].to_numpy(), accounted[f"{q.column}_predicted"].to_numpy()
        )
    return quality
