"""How good a record is: each finding against a record made to have it, or not to have it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.records.quality.excitation import excitation
from adaptive_flot.records.quality.relations import correlation, feedback
from adaptive_flot.records.quality.signals import noise

N = 1500


def loop(gain: float, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """First-order plant y, disturbed; input u: a random telegraph, and `gain` times the last measured error."""
    rng = np.random.default_rng(seed)
    dither = np.repeat(rng.choice([-1.0, 1.0], N // 10), 10)
    u, y = np.zeros(N), np.zeros(N)
    state = disturbance = 0.0
    for k in range(1, N):
        u[k] = 0.3 * dither[k] - gain * y[k - 1]
        disturbance = 0.98 * disturbance + 0.2 * rng.standard_normal()
        state += 0.2 * (u[k] - state)
        y[k] = state + disturbance + 0.05 * rng.standard_normal()
    return u, y


@pytest.mark.parametrize("seed", range(5))
def test_a_controller_is_seen_and_an_open_loop_is_not_taken_for_one(seed: int) -> None:
    """In open loop y follows u, which is no feedback however strong it is."""
    closed, free = feedback("u", "y", *loop(0.8, seed)), feedback("u", "y", *loop(0.0, seed))
    assert closed is not None and closed.closed
    assert free is not None and not free.closed


@pytest.mark.parametrize("seed", range(5))
def test_an_input_of_some_frequencies_is_no_feedback(seed: int) -> None:
    """Its own far past tells it, and a resonant output remembers that: a multisine was "left alone: in feedback"."""
    rng = np.random.default_rng(seed)
    tones, phases = np.arange(20, 300) / 4096, rng.uniform(0, 2 * np.pi, 280)
    u = np.cos(2 * np.pi * np.arange(N)[:, None] * tones + phases).sum(axis=1)
    y = lfilter([1.0], [1.0, -1.9, 0.95], u) + rng.standard_normal(N)
    found = feedback("u", "y", u, y)
    assert found is not None and not found.closed


def test_a_slow_analyser_is_held_between_its_values() -> None:
    u, y = loop(0.8)
    y[np.arange(N) % 2 == 1] = np.nan
    found = feedback("u", "y", u, y)
    assert found is not None and found.closed


def test_an_input_that_stands_still_has_no_relation() -> None:
    y = loop(0.0)[1]
    assert feedback("u", "y", np.ones(N), y) is None and correlation("u", "y", np.ones(N), y) is None


def test_the_lag_of_a_correlation_is_that_of_the_process() -> None:
    u = np.random.default_rng(1).standard_normal(N)
    y = -np.roll(u, 7)
    y[:7] = np.nan
    found = correlation("u", "y", u, y)
    assert found is not None and found.lag == 7 and found.r == pytest.approx(-1.0, abs=1e-9)


def test_the_order_of_excitation_is_that_of_the_book() -> None:
    """Ljung 1999, section 13.2: a constant about its mean 0, one sine 2, two sines 4, white noise any."""
    t = np.arange(4000)
    one, two = np.sin(0.7 * t), np.sin(0.7 * t) + np.sin(1.9 * t)
    orders = [
        excitation("u", v).order for v in (np.ones(4000), one, two, np.random.default_rng(0).standard_normal(4000))
    ]
    assert orders == [0, 2, 4, 20]


def test_whether_an_input_moves_is_judged_against_its_mean() -> None:
    wave = np.sin(np.arange(1000) / 7)
    assert [excitation("u", 100 + a * wave).word for a in (0.1, 0.6, 10)] == ["does not move", "hardly moves", "moves"]


def test_noise_is_told_from_slow_moves_and_spikes() -> None:
    rng = np.random.default_rng(2)
    values = 5 * np.sin(np.arange(5000) / 300) + 0.2 * rng.standard_normal(5000)
    values[::500] = 50.0
    values[7::90] = np.nan
    assert noise(values) == pytest.approx(0.2, rel=0.05)
