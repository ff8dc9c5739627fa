"""Times of a switch where the answer is known: the response to a step is the step itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.innovations.events.switching import Switch, best_switch, chance_of_edges

N = 120


def _steps() -> tuple[np.ndarray, np.ndarray]:
    edges = np.arange(1, N - 1)
    return (np.arange(N)[:, None] >= edges[None, :]).astype(float), edges


@settings(max_examples=15, deadline=None)
@given(
    starts=st.lists(st.integers(3, 100), min_size=1, max_size=3, unique=True),
    length=st.integers(4, 8),
    size=st.sampled_from([-2.0, 1.0, 5.0]),
)
def test_pulses_of_one_size_are_found_where_they_are(starts: list[int], length: int, size: float) -> None:
    kept = [a for i, a in enumerate(sorted(starts)) if i == 0 or a - sorted(starts)[i - 1] > length + 3]
    mask = np.zeros(N)
    for a in kept:
        mask[a : a + length] = 1.0
    steps, edges = _steps()
    noise = 0.05 * np.random.default_rng(0).normal(size=N)
    found = best_switch(steps, edges, size * mask + noise, N)
    assert found is not None
    np.testing.assert_array_equal(found.mask(N), mask)
    assert found.size == pytest.approx(size, abs=0.1)


def test_a_step_that_stays_has_no_end() -> None:
    steps, edges = _steps()
    found = best_switch(steps, edges, 3.0 * (np.arange(N) >= 70) + 0.1 * np.random.default_rng(1).normal(size=N), N)
    assert found is not None and found.pulses == ((70, N),)


def test_noise_alone_has_no_switch() -> None:
    """One in twenty at the most: the charge for times keeps noise out."""
    steps, edges = _steps()
    found = [best_switch(steps, edges, np.random.default_rng(k).normal(size=N), N) for k in range(20)]
    assert sum(f is not None for f in found) <= 1


def test_slow_edges_are_as_wide_as_half_the_pulse_or_the_pause_before_it() -> None:
    """Its sum is that of the pulse, and it lasts beyond the pulse on both sides by no more than that."""
    slow = Switch(((40, 60),), 1.0, 1.0).slow(N)
    assert slow.sum() == pytest.approx(20.0)
    assert slow[40:60].min() < 0.6 and slow[:30].max() == 0 and slow[70:].max() == 0
    stays = Switch(((90, N),), 1.0, 1.0).slow(N)
    assert stays[-1] == pytest.approx(1.0) and 0.4 < stays[90] < 0.6


def test_edges_at_the_steps_of_an_input_are_not_there_by_chance() -> None:
    """Four edges at four of five steps: a row in eight is as near to a step, so chance does it once in 8^4 = 4096."""
    steps = np.array([20, 40, 60, 80, 100])
    levels = np.cumsum(np.isin(np.arange(N), steps))[:, None].astype(float)
    assert chance_of_edges(np.array([20, 41, 59, 100]), levels) == pytest.approx(8.0**-4)
    assert chance_of_edges(np.array([30, 50, 70, 90]), levels) == 1.0
    # beside an input that moves in each row, the steps of the other are still seen
    both = np.column_stack([levels, np.arange(N)])
    assert chance_of_edges(np.array([20, 41, 59, 100]), both) == pytest.approx(2 * 8.0**-4)
    assert chance_of_edges(np.array([20, 40]), both[:, 1:]) == 1.0
    assert chance_of_edges(np.array([], dtype=int), levels) == 1.0
    assert chance_of_edges(np.array([20, 40]), np.empty((N, 0))) == 1.0


def test_edges_that_know_nothing_of_an_input_seem_to_follow_it_as_rarely_as_is_said() -> None:
    rng = np.random.default_rng(3)
    said = []
    for _ in range(300):
        held = np.repeat(rng.normal(size=N // 8), 8)[:, None]
        said.append(chance_of_edges(rng.choice(np.arange(1, N), 6, replace=False), held))
    for limit in (0.2, 0.05, 0.01):
        assert np.mean(np.array(said) < limit) <= limit + 0.02


@settings(max_examples=25, deadline=None)
@given(
    lengths=st.lists(st.integers(12, 18), min_size=3, max_size=3),
    pauses=st.lists(st.integers(5, 9), min_size=2, max_size=2),
)
def test_pulses_with_short_pauses_are_not_taken_for_one_long_one(lengths: list[int], pauses: list[int]) -> None:
    """The best single pulse spans them all, at a smaller size: only a pause within it leads on."""
    mask, at = np.zeros(N), 8
    for length, pause in zip(lengths, [*pauses, 0], strict=True):
        mask[at : at + length] = 1.0
        at += length + pause
    steps, edges = _steps()
    noise = 0.4 * np.random.default_rng(2).normal(size=N)
    found = best_switch(steps, edges, 2.0 * mask + noise, N)
    assert found is not None and len(found.pulses) == 3
    assert np.abs(found.mask(N) - mask).sum() <= 4
    assert found.size == pytest.approx(2.0, abs=0.3)
