"""A signal that is read at even times and kept in between is known by its record alone; what merely moves is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from adaptive_flot.discovery.record.even_steps import steps_evenly
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.candidates.test_readings import kept, wander

ROWS = 1200


def coloured(seed: int, memory: float) -> FloatArray:
    """Noise (ROWS,) of unit size with a memory from row to row."""
    drawn = np.random.default_rng(seed).normal(size=ROWS) * np.sqrt(1 - memory**2)
    noise: FloatArray = lfilter([1.0], [1.0, -memory], drawn)
    return noise


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(6.0, 25.0), st.floats(0.0, 1.0), st.floats(0.0, 0.7))
def test_what_is_kept_between_even_readings_is_found(seed: int, interval: float, phase: float, memory: float) -> None:
    """With coloured noise of a twentieth of the usual step, gaps and outliers; 48 readings at least."""
    shown = kept(wander(seed, ROWS), interval, phase * interval)
    steps = np.abs(np.diff(shown))
    shown = shown + 0.05 * float(np.median(steps[steps > 0])) * coloured(seed + 1, memory)
    draw = np.random.default_rng(seed + 2)
    shown[draw.integers(0, ROWS, 5)] *= 3
    start = int(draw.integers(0, ROWS - 100))
    shown[start : start + 60] = np.nan
    assert steps_evenly(shown)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(6, 50), st.floats(0.5, 0.98))
def test_what_moves_with_an_input_that_is_switched_at_even_times_is_not_kept(
    seed: int, interval: int, pole: float
) -> None:
    """Its moves are large at even times, too; it goes on in between."""
    moved = np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], ROWS // interval + 1), interval)[:ROWS]
    slow = max(pole, float(np.exp(-3.0 / interval)))  # it is at most nearly settled at the next move
    shown = lfilter([1 - slow], [1.0, -slow], moved) + 0.01 * coloured(seed + 1, 0.0)
    assert not steps_evenly(shown)


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_a_smooth_course_have_no_steps(seed: int) -> None:
    assert not steps_evenly(coloured(seed, 0.9))
    assert not steps_evenly(wander(seed, ROWS))


def test_a_signal_that_never_moves_and_one_that_is_hardly_measured_have_none() -> None:
    assert not steps_evenly(np.ones(ROWS))
    assert not steps_evenly(np.full(ROWS, np.nan))
    assert not steps_evenly(np.arange(30.0))
