"""Single values far off make no record differ from its reference; what is larger, or lasts, does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from adaptive_flot.discovery.hypotheses.joint.at_noise import are_usual
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray

ROWS, MEMORY = 1300, 0.2


def _errors(seed: int) -> FloatArray:
    """Errors of standard deviation 1 with a little memory (N, 1)."""
    noise = np.random.default_rng(seed).standard_normal(ROWS)
    found: FloatArray = np.sqrt(1 - MEMORY**2) * lfilter([1.0], [1.0, -MEMORY], noise)[:, None]
    return found


def _usual(errors: FloatArray) -> bool:
    n = len(errors)
    data = Dataset("record", np.arange(1.0, n + 1), 1.0, np.zeros((n, 1)), np.zeros((n, 1)))
    rows = Rows((data,), (0,), (np.ones((n, 1)),), (np.ones(n, dtype=bool),))
    return bool(are_usual(rows, [errors], rows, [_errors(0)])[0])


def _with_outliers(errors: FloatArray, seed: int) -> FloatArray:
    at = np.random.default_rng(seed).choice(ROWS, 6, replace=False)
    found = errors.copy()
    found[at] += 12.0
    return found


@pytest.mark.parametrize("seed", range(1, 9))
def test_outliers_do_not_count(seed: int) -> None:
    errors = _with_outliers(_errors(seed), seed)
    assert np.sqrt(np.mean(errors**2)) > 1.15
    assert _usual(errors)


@pytest.mark.parametrize("seed", range(1, 5))
def test_larger_noise_and_what_wanders_count(seed: int) -> None:
    assert not _usual(1.2 * _errors(seed))
    slow = np.cumsum(np.random.default_rng(seed).standard_normal(ROWS))[:, None]
    assert not _usual(_errors(seed) + 0.5 * slow / slow.std())


def test_a_short_event_counts_as_it_lasts() -> None:
    errors = _errors(3)
    errors[400:500] += 3.0
    assert not _usual(errors)
