"""Simulate a table of inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset, read_dataset
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper

MEASURED = "_measured"
"""Behind the name of a column of an output: what the record has of it."""


def simulate_file(path: Source, model: Model, *, accurate: bool = False) -> pd.DataFrame:
    """Simulate the inputs of a table; see `simulate_record`.

    Raises
    ------
    DataError, RangeError
        The table can not be used, or the simulation leaves the model's physical range.
    """
    return simulate_record(read_dataset(path, model), model, accurate=accurate)


@dataclass(frozen=True)
class Start:
    """Where a simulation starts: the state (nx,), and in words where that is from."""

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
    measured = {q.name: record.outputs[:, j] for j, q in enumerate(model.outputs)}
    columns |= {q.column + MEASURED: measured[q.name] for q in model.outputs if q.name in record.measured(model)}
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
        return Start(record.initial_state, "the states in the first row")
    parameters = model.parameter_values.copy()
    for name, values in record.parameters.items():
        parameters[model.index("parameters", name)] = values[0]
    at_rest = "the steady state of the first row's inputs"
    try:
        state, elsewhere = steady_state(model, record.inputs[0], parameters, time=float(record.time[0])).state, at_rest
    except RangeError:
        if model.starts_steady:
            raise
        state, elsewhere = model.first_guess, "the initial_guess"  # a battery never rests
    if model.starts_steady:
        return Start(state, at_rest)
    shown = {(q.name, q.unit): y for q, y in zip(model.outputs, record.outputs[0], strict=True) if np.isfinite(y)}
    parts: dict[str, list[str]] = {}
    for j, q in enumerate(model.states):
        if (q.name, q.unit) in shown:
            state[j], source = shown[q.name, q.unit], "as measured in the first row"
        else:
            source = f"at {elsewhere}"
        parts.setdefault(source, []).append(q.name)
    return Start(state, "; ".join(f"{', '.join(names)} {source}" for source, names in parts.items()))


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
