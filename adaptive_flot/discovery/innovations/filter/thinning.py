"""A long record with fewer rows, for the innovations form: its time grows with rows times states.

Inputs are means over the longer interval, so that what they bring in is kept. Outputs are those of the rows kept: their
noise is that of the sensor. What happens within an interval is lost. The name that is found is judged on all rows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model

MOST_WORK = 5_000
"""Rows times states up to which a record is taken as it is: half the rows lost friction that came in three spells."""
THINNED_TO = 4_000
"""Rows times states that are left of a longer record at most."""
MOST_SINCE_REFERENCE = 9_000
"""The same where a reference tells the constants: half a minute on two cores."""
USUAL_STATES = 3
"""States up to which each costs as much as the first."""
USUAL_STEPS = 8
"""Integration steps a row up to which these make little difference."""
FEWEST_ROWS = 500
"""Fewest rows that may be left of a longer record, which is thinned to as much work: fewer show no event."""


def is_short(record: Dataset, model: Model) -> bool:
    """Whether a record is short enough for the innovations form as it is; that of a stiff model takes longer."""
    return _work(record, model) <= MOST_WORK


def is_short_since_reference(record: Dataset, model: Model) -> bool:
    """Whether a record with a reference is short enough for the innovations form; it is never thinned."""
    many = max(1.0, len(model.states) / USUAL_STATES)
    return many * _work(record, model) <= MOST_SINCE_REFERENCE or is_short(record, model)


def _work(record: Dataset, model: Model) -> float:
    return len(record) * len(model.states) * max(1.0, model.steps_in(record.dt) / USUAL_STEPS)


def searchable(record: Dataset, model: Model) -> Dataset | None:
    """The record, thinned where it is long; None where too few rows would be left for so many states."""
    if is_short(record, model):
        return record
    thin = thinned(record, -(-len(record) * len(model.states) // THINNED_TO))
    return thin if len(thin) >= FEWEST_ROWS else None


def thinned(record: Dataset, apart: int) -> Dataset:
    """Every k-th row of a record, the first one too, with the mean of the inputs since the row before."""
    kept = np.arange(0, len(record), apart)
    total = np.cumsum(record.inputs, axis=0)[kept]
    means = np.vstack([record.inputs[:1], np.diff(total, axis=0) / apart])
    return replace(
        record,
        time=record.time[kept],
        dt=apart * record.dt,
        inputs=means,
        outputs=record.outputs[kept],
        parameters={name: values[kept] for name, values in record.parameters.items()},
    )
