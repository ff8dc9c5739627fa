"""What was seen at every site, and of every driver, along the runs of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.fit import JointFit
from adaptive_flot.discovery.record.seen import Seen, seen_along
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

AT_REST = 1e-3
"""A part is at rest where it gives less than this share of the most that it gives."""


def ordinary_size(value: FloatArray) -> float:
    """Median size of a value (N,); where it is at rest for half of the time or more, that of the other rows.

    A pump that runs for a third of the time has a size all the same: it may give 25 % less.
    """
    size = np.abs(value)
    median, least = float(np.median(size)), AT_REST * float(size.max(initial=0.0))
    if median > least or not least > 0:  # a value that is not known has no size either
        return median
    return float(np.median(size[size > least]))


def seen_values(model: Model, fit: JointFit, records: Sequence[Dataset]) -> tuple[Seen, Seen]:
    """Values at every site, and of every driver, along the free runs of a fit, the records behind one another."""
    fitted = model.with_parameters(fit.values)
    each = [seen_along(fitted, record, x0) for record, x0 in zip(records, fit.initial, strict=True)]
    sites, drivers = ({k: np.concatenate([one[i][k] for one in each]) for k in each[0][i]} for i in (0, 1))
    return sites, drivers
