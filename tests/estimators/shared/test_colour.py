"""Colour of the errors of a fit: white noise, slow errors, outliers, and few or no values."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from estimators.shared.colour import colour


def test_white_noise_has_a_colour_of_about_one() -> None:
    """Over many records of 600 rows; one in a hundred goes beyond 2, from which a model counts as wrong."""
    found = colour(np.random.default_rng(1).normal(size=(600, 400)))
    assert abs(found.mean() - 1) < 0.1
    assert np.mean(found > 2.0) < 0.02


def test_slow_errors_have_the_long_run_variance_of_their_autoregression() -> None:
    """E_k = a e_(k-1) + noise: (1 + a) / (1 - a), the mean over two hundred records."""
    noise = np.random.default_rng(2).normal(size=(2000, 200))
    found = [colour(lfilter([1.0], [1.0, -a], noise, axis=0)).mean() for a in (0.0, 0.5, 0.9)]
    np.testing.assert_allclose(found, [1.0, 3.0, 19.0], rtol=0.2)


def test_outliers_do_not_hide_a_correlation() -> None:
    generator = np.random.default_rng(3)
    slow = lfilter([1.0], [1.0, -0.9], generator.normal(size=2000))
    spoilt = slow + 100.0 * (generator.random(2000) < 0.02)
    assert colour(spoilt[:, None])[0] > 0.5 * colour(slow[:, None])[0] > 5.0


def test_what_is_missing_is_closed_up() -> None:
    errors = np.full((900, 3), np.nan)
    errors[::3, 0] = errors[:300, 1] = np.random.default_rng(4).normal(size=300)
    found = colour(errors)
    assert found[0] == found[1] and np.isnan(found[2])


@pytest.mark.parametrize("errors", [[0.3], [0.2, -0.1], [0.0] * 50])
def test_few_values_and_no_errors_are_white(errors: list[float]) -> None:
    assert 0 <= colour(np.array(errors)[:, None])[0] <= 1
