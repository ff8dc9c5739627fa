"""The noise model: known processes are recovered, outliers do not steer it, what is slow is not called noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.signal import lfilter

from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.discovery.record.noise import MEMORY, Noise, _memory, fit_noise, proportional
from adaptive_flot.discovery.record.robust import clipped_std, without_spikes

ROWS = np.ones(3000, dtype=bool)


def _ar(a: float, seed: int, rows: int = 3000) -> np.ndarray:
    e = np.random.default_rng(seed).standard_normal(rows)
    found: np.ndarray = lfilter([1.0], [1.0, -a], e)
    return found


@given(st.integers(0, 1000), st.floats(0.0, 0.8))
def test_an_autoregression_is_recovered_and_whitened(seed: int, a: float) -> None:
    r = _ar(a, seed)[:, None]
    noise = fit_noise(r, ROWS, np.array([0.0]))
    assert noise.std[0] == pytest.approx(1.0, rel=0.08)
    assert np.sum(noise.lags[0]) == pytest.approx(a, abs=0.12)
    assert noise.stationary_std()[0] == pytest.approx(1 / np.sqrt(1 - a**2), rel=0.12)
    white = noise.whiten(r)[5:, 0]
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.06


@pytest.mark.parametrize(("a", "expected"), [(0.0, 1.0), (0.5, 1 / np.sqrt(0.75)), (-0.6, 1.25)])
def test_spread_of_an_autoregression_is_the_closed_form(a: float, expected: float) -> None:
    """Variance of x_k = a x_{k-1} + e: 1 / (1 - a^2)."""
    assert Noise(np.ones(1), np.array([[a, 0.0, 0.0]])).stationary_std()[0] == pytest.approx(expected, rel=1e-3)


@given(poles=st.lists(st.floats(-1.3, 1.3), min_size=3, max_size=3))
def test_memory_is_infinite_from_the_unit_circle_on(poles: list[float]) -> None:
    """Whatever the response to an impulse still shows; else the size is that of a longer response."""
    a = np.asarray(-np.poly(poles)[1:], dtype=np.float64)
    reach = np.max(np.abs(poles))
    assume(abs(reach - 1) > 1e-3)
    if reach > 1:
        assert _memory(a) == np.inf
    else:
        longer = lfilter([1.0], np.concatenate([[1.0], -a]), np.eye(1, 100_000)[0])
        assert _memory(a) == pytest.approx(np.sqrt(np.sum(longer**2)), rel=0.3 if reach > 0.99 else 1e-3)


def test_a_slow_wave_is_not_called_noise() -> None:
    """A random walk over white noise: a free autoregression would explain it all, and with it the missing effect."""
    slow = np.cumsum(np.random.default_rng(3).standard_normal(3000))[:, None]
    noise = fit_noise(slow, ROWS, np.array([0.0]))
    assert noise.stationary_std()[0] <= MEMORY * noise.std[0] * 1.01
    assert noise.std[0] > 5  # with a free memory the innovations would be of size 1, and nothing left to explain


def test_outliers_do_not_steer_the_size() -> None:
    clean = np.random.default_rng(1).standard_normal(3000)
    spoilt = clean.copy()
    spoilt[::100] = 50.0
    assert clipped_std(spoilt) == pytest.approx(clipped_std(clean), rel=0.1)
    assert clipped_std(clean) == pytest.approx(1.0, rel=0.05)
    assert np.isnan(clipped_std(np.full(5, np.nan)))


def test_missing_samples_and_a_sparse_assay_have_white_noise() -> None:
    r = _ar(0.7, 4)[:, None]
    r[np.arange(3000) % 30 != 0] = np.nan
    noise = fit_noise(r, ROWS, np.array([0.0]))
    assert not noise.lags.any() and noise.std[0] == pytest.approx(1 / np.sqrt(1 - 0.49), rel=0.2)


def test_noise_that_grows_with_the_value_is_weighted_and_other_noise_is_not() -> None:
    rng = np.random.default_rng(5)
    y = np.repeat(rng.uniform(1, 5, 60), 50)[:, None]
    grows = 0.02 * y * rng.standard_normal(y.shape)
    weights = proportional(grows, y)
    assert np.allclose(weights / y, weights[0] / y[0], rtol=1e-9) and np.mean(weights) == pytest.approx(1, rel=0.02)
    assert np.all(proportional(0.05 * rng.standard_normal(y.shape), y) == 1.0)


@given(st.integers(0, 1000), st.sampled_from([0.0, 0.5, 0.9]))
def test_spikes_go_and_the_rest_stays(seed: int, a: float) -> None:
    """Twenty spikes of 30 standard deviations on an autoregression: they go to where their neighbours are."""
    r = _ar(a, seed)
    where = np.random.default_rng(seed).choice(np.arange(5, 2995, 5), 20, replace=False)
    spiked = r.copy()
    spiked[where] += 30.0
    found = without_spikes(spiked[:, None])[:, 0]
    assert np.max(np.abs(found[where] - r[where])) < 8.0
    others = np.setdiff1d(np.arange(3000), where)
    assert np.mean(found[others] != spiked[others]) < 0.01


def test_a_step_is_no_spike_and_missing_values_stay_missing() -> None:
    r = _ar(0.3, 1)
    r[1500:] += 50.0
    r[100:110] = np.nan
    found = without_spikes(r[:, None])[:, 0]
    assert np.isnan(found[100:110]).all() and np.isfinite(np.delete(found, range(100, 110))).all()
    assert np.nanmean(found[1600:]) - np.nanmean(found[:1400]) == pytest.approx(50.0, abs=0.5)


@pytest.mark.parametrize(("a", "expected"), [(0.0, 1.0), (0.5, 3.0), (0.8, 9.0)])
def test_correlation_time_of_an_autoregression_is_the_closed_form(a: float, expected: float) -> None:
    """1 + 2 sum a^k = (1 + a) / (1 - a)."""
    found = np.mean([correlation_times(_ar(a, s, 20_000)[:, None])[0] for s in range(5)])
    assert found == pytest.approx(expected, rel=0.15)
