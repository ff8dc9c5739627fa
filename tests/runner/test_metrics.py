"""Figures of merit from numbers whose answer is plain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.metrics import fit, rmse


def test_fit_by_hand() -> None:
    """|error| = 5, |truth| = 10."""
    assert fit(np.array([6.0, 8.0]), np.array([9.0, 4.0])) == pytest.approx(50.0)


@given(st.lists(st.floats(0.1, 10), min_size=1, max_size=5), st.floats(0, 3))
def test_fit_of_a_share_off_is_that_share_below_hundred(truth: list[float], share: float) -> None:
    t = np.array(truth)
    assert fit(t, (1 + share) * t) == pytest.approx(100 * (1 - share), abs=1e-9)


def test_fit_is_nan_where_the_estimate_has_a_hole() -> None:
    assert np.isnan(fit(np.ones(3), np.array([1.0, np.nan, 1.0])))


def test_rmse_by_hand_and_over_what_is_there() -> None:
    assert rmse(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5))
    assert rmse(np.array([3.0, np.nan, -4.0])) == pytest.approx(np.sqrt(12.5))
    assert np.isnan(rmse(np.array([np.nan]))) and np.isnan(rmse(np.array([])))
