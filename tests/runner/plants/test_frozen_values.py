"""A frozen instrument is noticed, and only a frozen one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import PlantRecord, Sample
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.processes import cascaded_tanks
from adaptive_flot.runner.plants.frozen_values import FrozenValues

INPUTS = np.array([1.0])


@dataclass(frozen=True)
class Played:
    """A plant that shows given values of its only output."""

    values: tuple[float, ...]

    def init(self) -> int:
        return 0

    def apply(self, state: int, inputs: FloatArray) -> tuple[int, PlantRecord]:
        shown = np.array([self.values[state]])
        return state + 1, PlantRecord(Sample(state + 1.0, inputs, shown), shown, np.empty(0), inputs)


def seen(*values: float, longest: float = 3.0) -> list[float]:
    model = cascaded_tanks.make_model()
    plant = FrozenValues(Played(values), model, {model.names("outputs")[0]: longest})
    state, found = plant.init(), []
    for _ in values:
        state, record = plant.apply(state, INPUTS)
        found.append(float(record.sample.outputs[0]))
    return found


def test_a_value_that_repeats_itself_too_long_is_missing_until_it_changes() -> None:
    shown = seen(1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 3.0)
    np.testing.assert_array_equal(shown, [1.0, 2.0, 2.0, 2.0, np.nan, np.nan, 3.0, 3.0])


def test_gaps_do_not_make_a_value_new() -> None:
    """A hanging analyser with a loose wire still hangs."""
    shown = seen(2.0, np.nan, 2.0, np.nan, 2.0, 2.5)
    np.testing.assert_array_equal(shown, [2.0, np.nan, 2.0, np.nan, np.nan, 2.5])


def test_what_changes_is_believed() -> None:
    assert seen(1.0, 1.1, 1.0, 1.1, 1.0) == [1.0, 1.1, 1.0, 1.1, 1.0]
