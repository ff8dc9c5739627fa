"""What jumps behind a demand: by property, and against positions that were drawn row by row."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.record.slip_jump import LEAST_JUMPS, asked_from_outside, jumped, jumping, same_jumps
from adaptive_flot.processes.flotation.cell import make_model
from tests.discovery.heated import heated_tank

DEMANDS = st.lists(st.floats(-5, 5), min_size=2, max_size=40).map(np.array)


SHARES = st.floats(0.0, 0.99)


@given(DEMANDS, st.floats(0.01, 3.0), SHARES)
def test_it_is_where_it_was_or_a_rest_from_what_is_asked_and_never_further_behind_than_the_band(
    v: np.ndarray, band: float, share: float
) -> None:
    rest = share * band
    position = jumped(v, band, rest)
    before = np.concatenate([v[:1], position[:-1]])
    stayed = np.abs(v - before) <= band
    np.testing.assert_array_equal(position[stayed], before[stayed])
    np.testing.assert_allclose(np.abs(v - position)[~stayed], rest, atol=1e-12)
    assert np.all(np.sign(position - before)[~stayed] == np.sign(v - before)[~stayed])
    assert np.all(np.abs(v - position) <= band)


@given(DEMANDS, st.floats(0.01, 3.0), SHARES, st.floats(0.0, 1.0))
def test_all_bands_of_the_range_draw_the_same_jumps_and_its_end_does_not(
    v: np.ndarray, band: float, rest: float, share: float
) -> None:
    rest *= band
    least, largest = same_jumps(v, band, rest)
    assert least <= band < largest
    if np.isfinite(largest):
        between = least + share * (largest - least)
        if between < largest:  # the least band that holds a jump back is not one of them
            np.testing.assert_array_equal(jumped(v, between, rest), jumped(v, band, rest))
        assert not np.array_equal(jumped(v, largest, rest), jumped(v, band, rest))


@given(DEMANDS)
def test_each_set_of_jumps_is_tried_once(v: np.ndarray) -> None:
    tried = list(jumping(v))
    assert all(np.count_nonzero(np.diff(position)) >= LEAST_JUMPS for *_, position in tried)
    assert len({(rest, position.tobytes()) for _, rest, _, position in tried}) == len(tried)
    assert all(band > rest for band, rest, *_ in tried)
    without = [(band, position.tobytes()) for band, rest, _, position in tried if not rest]
    assert without == sorted(without, key=lambda each: each[0])
    assert len({position for _, position in without}) == len(without)


def test_a_valve_that_the_model_moves_itself_does_not_follow_the_record() -> None:
    assert asked_from_outside(heated_tank()) >= {"heating"}
    outside = asked_from_outside(make_model())
    assert "air_flow" in outside and "tails_valve" not in outside
