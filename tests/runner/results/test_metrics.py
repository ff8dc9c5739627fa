"""Figures of merit from numbers whose answer is plain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.metrics import fit, normalised_error_squared, rmse


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


@given(seed=st.integers(0, 10**6), q=st.integers(1, 3))
def test_normalised_error_of_an_honest_estimator_is_chi_squared(seed: int, q: int) -> None:
    """Its mean is the number of parameters whatever the covariance, here from whitened unit errors."""
    generator = np.random.default_rng(seed)
    halves = generator.normal(size=(5, q, q)) + 2 * np.eye(q)
    unit = generator.normal(size=(5, q))
    error = np.einsum("nij,nj->ni", halves, unit)
    found = normalised_error_squared(error, halves @ halves.transpose(0, 2, 1))
    np.testing.assert_allclose(found, (unit**2).sum(axis=1), rtol=1e-4)


def test_normalised_error_is_unknown_where_the_covariance_is_singular_or_missing() -> None:
    covariance = np.stack([np.eye(2), np.ones((2, 2)), np.full((2, 2), np.nan), np.zeros((2, 2))])
    found = normalised_error_squared(np.ones((4, 2)), covariance)
    assert found[0] == pytest.approx(2.0) and np.isnan(found[1:]).all()
