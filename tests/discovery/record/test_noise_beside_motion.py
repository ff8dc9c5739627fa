"""Protects: the noise of a table is that of the sensor, also where the process moves much from row to row.

An oscillator of 32 rows a period had a "noise" of 0.037 mm where its sensor has 0.008 mm.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from adaptive_flot.discovery.record.robust import noise_beside_motion, noise_by_differences

ROWS = 3000


@settings(max_examples=20, deadline=None)
@given(period=st.floats(25.0, 400.0), swing=st.floats(0.0, 100.0), seed=st.integers(0, 1000))
def test_a_swing_is_no_noise(period: float, swing: float, seed: int) -> None:
    noise = np.random.default_rng(seed).normal(size=ROWS)
    moves = swing * np.sin(2 * np.pi * np.arange(ROWS) / period + seed)
    assert noise_beside_motion((moves + noise)[:, None])[0] == pytest.approx(1.0, rel=0.5)
    assert noise_beside_motion((moves + noise)[:, None])[0] >= 0.85


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_noise_with_a_memory_is_as_large_as_from_row_to_row(memory: float) -> None:
    """A memory is no motion: the estimate stays that of the first differences."""
    for seed in range(10):
        white = np.random.default_rng(seed).normal(size=(ROWS, 1))
        coloured = lfilter([1.0], [1.0, -memory], white, axis=0)
        assert noise_beside_motion(coloured) == pytest.approx(noise_by_differences(coloured))


def test_a_coarse_resolution_is_no_motion() -> None:
    """Of a grade in steps of its noise, the medians are multiples of a step: a healthy record was `abstain` by that."""
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(size=(ROWS, 1))
        coarse = 2.0 * np.round(noise / 2.0)
        assert noise_beside_motion(coarse) == pytest.approx(noise_by_differences(coarse))


def test_missing_values_and_rare_ones_are_no_obstacle() -> None:
    series = np.random.default_rng(1).normal(size=(ROWS, 2))
    series[::7, 0] = np.nan
    series[np.arange(ROWS) % 50 != 0, 1] = np.nan
    assert noise_beside_motion(series) == pytest.approx([1.0, 1.0], rel=0.4)
    assert np.isnan(noise_beside_motion(np.full((5, 1), np.nan))).all()
