"""Simulate a table of inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper

MEASURED = "_measured"
"""Behind the name of a column of an output: what the record has of it."""


@dataclass(frozen=True)
class Start:
    """Where a simulation starts: the state (nx,), and in words where that is from ("at the steady state ...")."""

    state: FloatArray
    words: str


def simulate_record(record: Dataset, model: Model, *, accurate: bool = False) -> pd.DataFrame:
    """Every state, output and signal of the model for the inputs (and parameters) of a record.

    Row 0 is the initial condition, see `start_of`. Each further row holds inputs and parameters during the interval
    that ends at its time.

    Parameters
    ----------
    record
        The record; its outputs are shown beside the simulated ones, and may say where it starts.
    model
        The model.
    accurate
        IDAS on the DAE instead of the fast step.

    Returns
    -------
    DataFrame
        `time_s`, inputs, parameters of the record by label, outputs, signals, and the states that are no outputs. What
        is measured has `_measured` behind the name of its column.

    Raises
    ------
    RangeError
        A state leaves its physical range or is not finite; names the state and the time.
    """
    p = np.tile(model.parameter_values, (len(record), 1))
    for name, values in record.parameters.items():
        p[:, model.index("parameters", name)] = values
    _check_parameters(record, model)
    x0 = start_of(record, model).state
    stepper = Stepper(model, record.dt, accurate=accurate)
    run = stepper.simulate(x0, record.inputs[1:], p[1:], record.time[0])
    states = np.vstack([x0, run.states])
    _check_states(record, model, states)
    first = stepper.outputs_at(x0, record.time[0], record.inputs[0], p[0])
    shown = np.vstack([first, np.hstack([run.outputs, run.signals])])

    columns: dict[str, FloatArray] = {TIME_COLUMN: record.time}
    columns |= {q.column: record.inputs[:, j] for j, q in enumerate(model.inputs)}
    labels = [(model.parameters[model.index("parameters", n)].label, v) for n, v in record.parameters.items()]
    columns |= dict(labels)
    columns |= {q.column: shown[:, j] for j, q in enumerate((*model.outputs, *model.signals))}
    for j, q in enumerate(model.states):
        columns.setdefault(q.column, states[:, j])
    for q, values in zip(model.outputs, record.outputs.T, strict=True):
        if np.isfinite(values).any():
            columns[q.column + MEASURED] = values
    return pd.DataFrame(columns)


def start_of(record: Dataset, model: Model) -> Start:
    """Where the simulation of a record starts.

    The states in the first row, if it holds all of them. Else the steady state of that row's inputs, or the
    `initial_guess` of a model that has none and need not start steady. In such a model a state starts where an output
    of its name shows it.

    Parameters
    ----------
    record, model
        What is simulated.

    Raises
    ------
    RangeError
        A model that starts steady has no steady state there.
    """
    if record.initial_state is not None:
        return Start(record.initial_state, "with the states in the first row")
    parameters = model.parameter_values.copy()
    for name, values in record.parameters.items():
        parameters[model.index("parameters", name)] = values[0]
    words = "at the steady state of the first row's inputs"
    try:
        state = steady_state(model, record.inputs[0], parameters, time=float(record.time[0])).state.copy()
    except RangeError:
        if model.starts_steady:
            raise
        state, words = model.first_guess, "at the initial_guess"  # a battery never rests
    if model.starts_steady:
        return Start(state, words)
    shown = {(q.name, q.unit): y for q, y in zip(model.outputs, record.outputs[0], strict=True) if np.isfinite(y)}
    measured = [j for j, q in enumerate(model.states) if (q.name, q.unit) in shown]
    for j in measured:
        state[j] = shown[model.states[j].name, model.states[j].unit]
    if measured:
        words += f", but with {', '.join(model.states[j].name for j in measured)} as measured there"
    return Start(state, words)


def misfit(table: pd.DataFrame, model: Model) -> dict[str, float]:
    """Root mean square of measured minus simulated, by name of the output, from a table of `simulate_record`."""
    return {
        q.name: float(np.sqrt(np.nanmean((table[q.column + MEASURED] - table[q.column]) ** 2)))
        for q in model.outputs
        if q.column + MEASURED in table
    }


def _check_parameters(record: Dataset, model: Model) -> None:
    for name, values in record.parameters.items():
        parameter = model.parameters[model.index("parameters", name)]
        bad = np.flatnonzero(~((values >= parameter.lower) & (values <= parameter.upper)))
        if bad.size:
            raise RangeError(
                f"{record.name}: parameter {parameter.label} = {values[bad[0]]:g} {parameter.unit} at time "
                f"{record.time[bad[0]]:g} s is outside its physical range [{parameter.lower:g}, {parameter.upper:g}]; "
                "correct the value"
            )


def _check_states(record: Dataset, model: Model, states: FloatArray) -> None:
    for j, q in enumerate(model.states):
        bad = np.flatnonzero(~((states[:, j] >= q.lower) & (states[:, j] <= q.upper)))
        if bad.size:
            k = int(bad[0])
            raise RangeError(
                f"{record.name}: {q.description} ({q.name}) leaves its range [{q.lower:g}, {q.upper:g}] {q.unit} at "
                f"time {record.time[k]:g} s with {states[k, j]:g} {q.unit}; check the inputs before that time"
            )
