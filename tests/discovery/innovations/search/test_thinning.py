"""A long record is thinned so that what its inputs bring in, and what its outputs show, is kept."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.filter.thinning import (
    FEWEST_ROWS,
    MOST_WORK,
    THINNED_TO,
    is_short,
    is_short_since_reference,
    searchable,
    thinned,
)
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.innovations.box import DT, model, record


def long(rows: int) -> Dataset:
    return Dataset("long", np.arange(rows, dtype=float), 1.0, np.ones((rows, 1)), np.zeros((rows, 1)))


def of_states(count: int, steps: int = 1) -> Any:
    return SimpleNamespace(states=range(count), steps_in=lambda dt: steps)


def test_a_short_record_is_taken_as_it_is() -> None:
    data = record(rows=80)
    assert searchable(data, model()) is data


@pytest.mark.parametrize("rows", [2501, 3600, 9600])
def test_a_long_record_is_thinned_to_what_takes_a_minute(rows: int) -> None:
    thin = searchable(long(rows), of_states(2))
    assert thin is not None and FEWEST_ROWS <= len(thin) <= THINNED_TO / 2 + 1
    assert is_short(thin, of_states(2))


def test_a_flotation_cell_has_too_many_states_to_be_asked() -> None:
    assert searchable(long(3000), of_states(9)) is None


@pytest.mark.parametrize("apart", [1, 2, 3])
def test_the_rows_kept_are_those_that_the_thinned_inputs_lead_to(apart: int) -> None:
    """The sum of the inputs up to every row kept is the same, and the free run of a slow model comes to the same."""
    data = record(rows=181)
    thin = thinned(data, apart)
    np.testing.assert_array_equal(thin.time, data.time[::apart])
    np.testing.assert_array_equal(thin.outputs, data.outputs[::apart])
    np.testing.assert_allclose(
        np.cumsum(thin.inputs[1:], axis=0) * apart,
        np.cumsum(data.inputs[1:], axis=0)[apart - 1 :: apart][: len(thin) - 1],
    )
    start, p = np.array([22.0, 22.0]), model().parameter_values
    full = RecordSimulator(model(), DT).outputs(data, start, p)[::apart]
    fast = RecordSimulator(model(), apart * DT).outputs(thin, start, p)
    np.testing.assert_allclose(fast, full, atol=0.02 * np.ptp(full))


def test_a_stiff_model_makes_a_record_long() -> None:
    """Each row then takes many integration steps, and the innovations form as many times as long."""
    assert is_short(long(1200), of_states(3, steps=8))
    assert not is_short(long(1200), of_states(3, steps=18))


def test_a_reference_allows_for_more_rows_but_not_with_many_states() -> None:
    """3,000 rows of three states; a day of an air handling unit, of five, stays one for free runs."""
    assert is_short_since_reference(long(3000), of_states(3)) and not is_short(long(3000), of_states(3))
    assert not is_short_since_reference(long(3001), of_states(3))
    assert not is_short_since_reference(long(1440), of_states(5))
    assert not is_short_since_reference(long(1500), of_states(3, steps=17))


@pytest.mark.parametrize("states", range(1, 12))
def test_what_is_short_is_short_with_a_reference_too(states: int) -> None:
    rows = MOST_WORK // states
    assert is_short(long(rows), of_states(states)) and is_short_since_reference(long(rows), of_states(states))
