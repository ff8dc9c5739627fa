"""A plant whose frozen instruments are noticed: a value that repeats itself to the bit for too long counts as missing.

A measurement with noise does not repeat itself. An analyser that hangs shows its last value. A controller that takes
this value for the present one drives the process away: with a grade above the limit, it adds air without end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyPlant, PlantRecord
from adaptive_flot.greybox.model import FloatArray, Model


@dataclass(frozen=True)
class WatchedState:
    """State of the plant, last value shown (ny,), since when it is shown (ny,) [s]; NaN before the first."""

    inner: Any
    shown: FloatArray
    since: FloatArray


class FrozenValues:
    """A plant around another: values of an output that have not changed for some time are missing from its samples.

    Parameters
    ----------
    plant
        The plant.
    model
        Names of the outputs.
    frozen_after_s
        By output: how long a value may repeat itself to the bit [s].
    """

    def __init__(self, plant: AnyPlant, model: Model, frozen_after_s: Mapping[str, float]) -> None:
        self._plant = plant
        self._longest = np.full(len(model.outputs), np.inf)
        for name, seconds in frozen_after_s.items():
            self._longest[model.index("outputs", name)] = seconds

    def init(self) -> WatchedState:
        """State at the start."""
        unknown = np.full(len(self._longest), np.nan)
        return WatchedState(self._plant.init(), unknown, unknown.copy())

    def apply(self, state: WatchedState, inputs: FloatArray) -> tuple[WatchedState, PlantRecord]:
        """Hold the inputs for one interval; see `Plant.apply`."""
        inner, record = self._plant.apply(state.inner, inputs)
        values, now = record.sample.outputs, record.sample.time
        came = np.isfinite(values)
        changed = came & (values != state.shown)
        shown, since = np.where(came, values, state.shown), np.where(changed, now, state.since)
        frozen = came & ~changed & (now - since > self._longest - 1e-9)
        if frozen.any():
            record = replace(record, sample=replace(record.sample, outputs=np.where(frozen, np.nan, values)))
        return WatchedState(inner, shown, since), record
