"""Errors k steps ahead: what a model is worth between one measurement and a free run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering.filter import Filtered
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper


def prediction_errors(
    stepper: Stepper,
    record: Dataset,
    filtered: Filtered,
    outputs: Sequence[int],
    walking: Sequence[str],
    p: FloatArray,
    steps: int,
) -> FloatArray:
    """Measured minus predicted outputs (N, m), each prediction made up to `steps` rows before.

    The record is cut into windows of `steps` rows. Each window runs free from the filtered state at its beginning, so
    that row i of a window is predicted i rows ahead. Walking parameters stay at their value of then.

    Parameters
    ----------
    stepper
        Of the model and the record's sampling interval.
    record, filtered
        N rows, and what the filter made of them.
    outputs, walking
        As the filter had them.
    p
        Parameters (np,).
    steps
        Longest horizon, in rows, at least 1.
    """
    model: Model = stepper.model
    nx, columns = len(model.states), list(outputs)
    found = np.full((len(record), len(columns)), np.nan)
    where = model.indices("parameters", walking)
    for start in range(0, len(record) - 1, steps):
        rows = slice(start + 1, min(start + 1 + steps, len(record)))
        now = p.copy()
        now[where] = filtered.z[start, nx:]
        run = stepper.simulate(filtered.z[start, :nx], record.inputs[rows], now, float(record.time[start]))
        found[rows] = record.outputs[rows][:, columns] - run.outputs[:, columns]
    return found
