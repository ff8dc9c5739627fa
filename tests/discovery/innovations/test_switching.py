"""Times of a switch where the answer is known: the response to a step is the step itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.innovations.switching import Switch, best_switch

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
