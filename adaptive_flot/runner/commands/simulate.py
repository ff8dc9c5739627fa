"""Simulate a table of inputs with the flotation model."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset, read_dataset
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper


def simulate_file(path: Source, model: Model, *, accurate: bool = False) -> pd.DataFrame:
    """Simulate the inputs of a table; see `simulate_record`.

    Raises
    ------
    DataError, RangeError
        The table can not be used, or the simulation leaves the model's physical range.
    """
    return simulate_record(read_dataset(path, model), model, accurate=accurate)


def simulate_record(record: Dataset, model: Model, *, accurate: bool = False) -> pd.DataFrame:
    """Every state, output and signal of the model for the inputs (and parameters) of a record.

    Row 0 is the initial condition: the states in it if it holds all of them, else the steady state of its inputs, or
    the `initial_guess` of a model that has none and does not start steady. Each further row holds inputs and parameters
    during the interval that ends at its time.

    Parameters
    ----------
    record
        The record; its outputs are not used.
    model
        The model.
    accurate
        IDAS on the DAE instead of the fast step.

    Returns
    -------
    DataFrame
        `time_s`, inputs, parameters of the record by label, outputs, signals, and the states that are no outputs.

    Raises
    ------
    RangeError
        A state leaves its physical range or is not finite; names the state and the time.
    """
    p = np.tile(model.parameter_values, (len(record), 1))
    for name, values in record.parameters.items():
        p[:, model.index("parameters", name)] = values
    _check_parameters(record, model)
    x0 = record.initial_state
    if x0 is None:
        x0 = _assumed_start(record, model, p[0])
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
    return pd.DataFrame(columns)


def _assumed_start(record: Dataset, model: Model, parameters: FloatArray) -> FloatArray:
    """State (nx,) at the first row of a record that does not hold it; `parameters` (np,) are those of that row."""
    try:
        return steady_state(model, record.inputs[0], parameters, time=float(record.time[0])).state
    except RangeError:
        if model.starts_steady:
            raise
        return model.first_guess  # a battery never rests


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
