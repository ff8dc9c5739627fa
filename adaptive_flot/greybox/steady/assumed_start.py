"""Whether a record starts at the steady state at which its model assumes it to start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.record import RecordSimulator

MATTERS = 5.0
"""Standard deviations of the noise by which an output must differ, in some row, for the start to matter."""


def wrong_start(
    model: Model, record: Dataset, state: FloatArray, parameters: FloatArray, columns: Sequence[int], noise: FloatArray
) -> tuple[str, ...]:
    """What is to be said of a record that does not start at the steady state of its first inputs.

    Nothing where the model does not assume that, where the record carries its initial state, and where it hardly
    matters: two free runs, from the steady state and from the fitted state, differ by less than MATTERS of the noise.

    Parameters
    ----------
    model, record
        The model with its assumption `starts_steady`, and the record.
    state
        Fitted state (nx,) at the first row.
    parameters
        Fitted parameter vector (np,).
    columns
        Indices of the m measured outputs.
    noise
        Standard deviation of the noise of each (m,).
    """
    if not model.starts_steady or record.initial_state is not None:
        return ()
    remedy = f"set starts_steady=False and initial_guess in model '{model.name}' if it does not start at rest"
    try:
        steady = steady_state(model, record.inputs[0], parameters, state, float(record.time[0])).state
    except RangeError:
        return (f"starts_steady=True was assumed, but the first inputs have no steady state: {remedy}",)
    run = RecordSimulator(model, record.dt)
    both = [run.outputs(record, x0, parameters)[:, list(columns)] for x0 in (steady, state)]
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(both[0] - both[1]) / np.maximum(noise, 1e-300)
    if np.nan_to_num(apart).max(initial=0.0) < MATTERS:
        return ()
    said = ", ".join(
        f"{q.name} {found:.4g} instead of {assumed:.4g} {q.unit}".removesuffix(" -")
        for q, found, assumed in zip(model.states, state, steady, strict=True)
        if abs(found - assumed) > 1e-3 * max(abs(assumed), abs(found))
    )
    return (
        f"starts_steady=True was assumed, and the record does not start so: its start was fitted ({said}); {remedy}",
    )
