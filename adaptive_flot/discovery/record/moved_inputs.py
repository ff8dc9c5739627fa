"""A record whose inputs act one row later than it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset

MOVED = "outputs follow the inputs one row later than the record says, so the inputs were moved down by one row"


def with_inputs_moved(record: Dataset) -> Dataset:
    """The record with each row's inputs in the row after it, those of the first row in both, and a note of that."""
    moved = np.vstack([record.inputs[:1], record.inputs[:-1]])
    return replace(record, inputs=moved, notes=(*record.notes, MOVED))
