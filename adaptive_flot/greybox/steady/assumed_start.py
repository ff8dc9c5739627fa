"""Whether a record starts at the steady state at which its model assumes it to start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Quantity
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.record import RecordSimulator

MATTERS = 5.0
"""Standard deviations of the noise by which an output must differ, in some row, for the start to matter."""
MOST_TOLD = 4
"""States that the note names."""
FIRST_ROWS = 10
"""Rows whose measured values say where a state starts."""
REMEDY = "in a model of your own, set starts_steady=False and initial_guess"


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
    try:
        steady = steady_state(model, record.inputs[0], parameters, state, float(record.time[0])).state
    except RangeError:
        return (f"a start at rest was assumed, but the first inputs have no steady state: it was fitted; {REMEDY}",)
    run = RecordSimulator(model, record.dt)
    both = [run.outputs(record, x0, parameters)[:, list(columns)] for x0 in (steady, state)]
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(both[0] - both[1]) / np.maximum(noise, 1e-300)
    if np.nan_to_num(apart).max(initial=0.0) < MATTERS:
        return ()
    said = _told(model, record, state, steady)
    return (
        "the model says that a record starts at rest, and this one does not: its start was fitted"
        f"{f' ({said})' if said else ''}, which is in order; to say so {REMEDY}",
    )


def _told(model: Model, record: Dataset, state: FloatArray, steady: FloatArray) -> str:
    """The states that differ most, over their scales, of those that the record can speak for.

    Where outputs hardly depend on a state, its fitted start may be anything within the first rows.
    """
    differ = [
        (abs(found - assumed) / q.scale, f"{q.name} {found:.4g} instead of {assumed:.4g} {q.unit}".removesuffix(" -"))
        for q, found, assumed in zip(model.states, state, steady, strict=True)
        if abs(found - assumed) > 1e-3 * max(abs(assumed), abs(found)) and _credible(model, record, q, found, assumed)
    ]
    return ", ".join(text for _, text in sorted(differ, key=lambda d: -d[0])[:MOST_TOLD])


def _credible(model: Model, record: Dataset, q: Quantity, found: float, assumed: float) -> bool:
    """Whether a fitted start lies in the ranges of its quantity, and nearer than `assumed` to what was measured."""
    shown = [o for o in model.outputs if o.name == q.name]
    for known in (q, *shown):
        low, high = known.usual or (known.lower, known.upper)
        if not max(low, known.lower) <= found <= min(high, known.upper):
            return False
    for output in shown:
        measured = record.outputs[:FIRST_ROWS, model.index("outputs", output.name)]
        measured = measured[np.isfinite(measured)]
        if measured.size and abs(found - np.median(measured)) > abs(assumed - np.median(measured)):
            return False
    return True
