"""Outliers are told from errors of the model: those stand alone, these last."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.greybox.model import FloatArray
from estimators.shared.outliers import belief

ROWS = 600


def noise(seed: int) -> FloatArray:
    return np.random.default_rng(seed).normal(size=ROWS)


@pytest.mark.parametrize("seed", range(5))
def test_gaussian_noise_is_believed_to_the_bit(seed: int) -> None:
    assert (belief(noise(seed)[:, None]) == 1).all()


@pytest.mark.parametrize("seed", range(5))
def test_values_far_off_are_found_and_the_others_believed(seed: int) -> None:
    e = noise(seed)
    wrong = np.arange(ROWS) % 20 == 7
    found = belief((e + np.where(wrong, 20.0, 0.0))[:, None])[:, 0]
    assert found[wrong].max() < 0.01
    assert found[~wrong].mean() > 0.98


@pytest.mark.parametrize(
    "slow",
    [
        15 * np.sin(np.arange(ROWS) / 20),
        np.where(np.arange(ROWS) // 60 % 2, 10.0, -10.0),
        10 * np.exp(-(np.arange(ROWS) % 100) / 15),
    ],
    ids=["wave", "steps", "transients"],
)
def test_errors_that_last_are_no_outliers(slow: FloatArray) -> None:
    assert (belief((slow + noise(3))[:, None]) == 1).all()


def test_outliers_beside_errors_that_last_are_still_found() -> None:
    e = 15 * np.sin(np.arange(ROWS) / 20) + noise(4)
    e[[100, 333]] += [25.0, -25.0]
    found = belief(e[:, None])[:, 0]
    assert np.flatnonzero(found < 0.5).tolist() == [100, 333]


def test_missing_values_few_values_and_a_constant_say_nothing() -> None:
    e = noise(5)[:, None]
    e[50] = 40.0
    e[::3] = np.nan
    found = belief(np.hstack([e, np.full_like(e, np.nan), np.zeros_like(e)]))
    assert found[50, 0] < 0.01
    assert np.isfinite(found).all() and (found[::3] == 1).all() and (found[:, 1:] == 1).all()
    assert (belief(e[:40]) == 1).all()


def test_noise_of_another_kind_in_a_third_of_the_samples_is_no_contamination() -> None:
    e = noise(6) * np.where(np.random.default_rng(6).random(ROWS) < 0.35, 30.0, 1.0)
    assert (belief(e[:, None]) == 1).all()
