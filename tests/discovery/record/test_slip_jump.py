"""What jumps behind a demand: by property, and against positions that were drawn row by row."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.record.slip_jump import LEAST_JUMPS, asked_from_outside, jumped, jumping, same_jumps
from adaptive_flot.processes.flotation.cell import make_model
from tests.discovery.heated import heated_tank

DEMANDS = st.lists(st.floats(-5, 5), min_size=2, max_size=40).map(np.array)


@given(DEMANDS, st.floats(0.01, 3.0))
def test_it_is_where_it_was_or_where_it_is_asked_to_be_and_never_further_behind_than_the_band(
    v: np.ndarray, band: float
) -> None:
    position = jumped(v, band)
    before = np.concatenate([v[:1], position[:-1]])
    assert np.all((position == v) | (position == before))
    assert np.all(np.abs(v - position) <= band)
    assert np.all(position[np.abs(v - before) > band] == v[np.abs(v - before) > band])


@given(DEMANDS, st.floats(0.01, 3.0), st.floats(0.0, 1.0))
def test_all_bands_of_the_range_draw_the_same_jumps_and_its_end_does_not(
    v: np.ndarray, band: float, share: float
) -> None:
    least, largest = same_jumps(v, band)
    assert least <= band < largest
    if np.isfinite(largest):
        between = least + share * (largest - least)
        if between < largest:  # the least band that holds a jump back is not one of them
            np.testing.assert_array_equal(jumped(v, between), jumped(v, band))
        assert not np.array_equal(jumped(v, largest), jumped(v, band))


@given(DEMANDS)
def test_each_set_of_jumps_is_tried_once(v: np.ndarray) -> None:
    tried = list(jumping(v))
    bands = [band for band, _ in tried]
    assert bands == sorted(bands)
    assert all(np.count_nonzero(np.diff(position)) >= LEAST_JUMPS for _, position in tried)
    assert len({position.tobytes() for _, position in tried}) == len(tried)


def test_a_valve_that_the_model_moves_itself_does_not_follow_the_record() -> None:
    assert asked_from_outside(heated_tank()) >= {"heating"}
    outside = asked_from_outside(make_model())
    assert "air_flow" in outside and "tails_valve" not in outside
