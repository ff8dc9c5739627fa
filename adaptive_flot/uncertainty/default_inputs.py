"""Inputs where no table of them is given: the air in steps over its operating range, all else at rest."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.flotation.parameters import Cell

DURATION_S, STEP_S, LEVELS = 2400, 1.0, 4


def default_inputs(model: Model, cell: Cell) -> Dataset:
    """Forty minutes of the flotation model at 1 s.

    The air goes up in four equal steps between the operating limits of the cell, ten minutes each. Feed flow is that
    of the cell, and the level set-point the middle of its limits.
    """
    time = STEP_S * np.arange(int(DURATION_S / STEP_S) + 1, dtype=float)
    low, high = cell.operation["air_flow_limits"]
    air = np.linspace(low, high, LEVELS)
    level = np.minimum((time * LEVELS / DURATION_S).astype(int), LEVELS - 1)
    feed, middle = cell.operation["feed_flow"][0], float(np.mean(cell.operation["level_limits"]))
    inputs = np.column_stack([air[level], np.full(time.size, feed), np.full(time.size, middle)])
    return Dataset("air in steps", time, STEP_S, inputs, np.full((time.size, len(model.outputs)), np.nan))
