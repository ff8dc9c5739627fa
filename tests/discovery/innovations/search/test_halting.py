"""A part that stays at one level for a time: its times and its level, where the response to a step is the step."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.innovations.events.halting import Halt, best_halt, still_stretch

N = 120
EDGES = np.arange(1, N - 1)
AFTER = (np.arange(N)[:, None] >= EDGES[None, :]).astype(float)


def _asked(seed: int) -> np.ndarray:
    """What the part is asked (N,): levels that are held for some rows each."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(0.0, 4.0, N // 5), 5)


def _found(
    v: np.ndarray, what_it_does: np.ndarray, seed: int, limits: tuple[float, float] = (0.0, 4.0)
) -> tuple[Halt | None, np.ndarray]:
    innovations = what_it_does - v + 0.05 * np.random.default_rng(seed).normal(size=N)
    return best_halt((AFTER * v[:, None], AFTER), EDGES, innovations, N, N, limits), innovations


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 1000),
    begin=st.integers(10, 60),
    length=st.integers(25, 50),
    level=st.sampled_from([0.5, 2.0, 3.5]),
)
def test_a_halt_is_found_where_it_is(seed: int, begin: int, length: int, level: float) -> None:
    v, end = _asked(seed), begin + length
    does = v.copy()
    does[begin:end] = level
    found, _ = _found(v, does, seed)
    assert found is not None and found.level == pytest.approx(level, abs=0.1)
    assert np.abs((does - v)[min(begin, found.begin) : max(begin, found.begin)]).max(initial=0.0) < 0.3
    assert np.abs((found.level - v)[min(end, found.end) : max(end, found.end)]).max(initial=0.0) < 0.3
    assert found.beyond > 10


def test_a_halt_that_lasts_has_no_end() -> None:
    v = _asked(1)
    found, _ = _found(v, np.where(np.arange(N) >= 70, 1.3, v), 1)
    assert found is not None and found.end == N and found.level == pytest.approx(1.3, abs=0.1)


def test_its_gain_is_the_largest_of_all_regressions_on_two_columns() -> None:
    """Against least squares, a pair of times at a time."""
    v = _asked(5)
    does = np.where((np.arange(N) >= 30) & (np.arange(N) < 80), 2.5, v)
    found, e = _found(v, does, 5)
    assert found is not None
    best = 0.0
    for a in range(1, N - 3):
        for b in [*range(a + 2, N - 1), N]:
            inside = ((np.arange(N) >= a) & (np.arange(N) < b)).astype(float)
            X = np.column_stack([inside * v, inside])
            size, left, rank, _ = np.linalg.lstsq(X, e, rcond=None)
            if rank == 2 and -size[0] >= 0.2 and 0 <= size[1] / -size[0] <= 4:
                best = max(best, N / 2 * float(np.log(e @ e / left[0])))
    assert found.gain == pytest.approx(best, rel=1e-9)


def test_where_nothing_else_was_asked_a_halt_is_no_more_than_a_constant_change() -> None:
    """An offset of what stays at one level is a halt at another one: `beyond` says that the record does not tell."""
    v = np.where(np.arange(N) < 60, _asked(2), 1.0)
    found, _ = _found(v, np.where(np.arange(N) < 60, v, 2.0), 2)
    assert found is None or found.beyond < 3.0


def test_a_level_outside_its_limits_is_none() -> None:
    v = _asked(3)
    found, _ = _found(v, np.where(np.arange(N) >= 50, 9.0, v), 3)
    assert found is None or 0.0 <= found.level <= 4.0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1000), begin=st.integers(20, 150), length=st.integers(30, 120), messy=st.booleans())
def test_a_sensor_that_is_still_is_found_where_it_is(seed: int, begin: int, length: int, messy: bool) -> None:
    """Where rows are missing, and some are far off, as well."""
    rng = np.random.default_rng(seed)
    shown = 60 + np.cumsum(0.5 * rng.normal(size=300)) + 0.1 * rng.normal(size=300)
    shown[begin : begin + length] = 25.0 + 0.1 * rng.normal(size=length)
    if messy:
        shown[rng.choice(300, 20, replace=False)] = np.nan
        shown[begin + length // 2] += 3.0
    found = still_stretch(shown, 0.1)
    assert found is not None
    assert abs(found[0] - begin) <= 5 and abs(found[1] - begin - length) <= 5
    assert found[2] == pytest.approx(25.0, abs=0.1)


def test_what_always_moves_or_never_does_is_not_still() -> None:
    rng = np.random.default_rng(0)
    assert still_stretch(np.cumsum(0.5 * rng.normal(size=300)), 0.1) is None
    assert still_stretch(25 + 0.1 * rng.normal(size=300), 0.1) is None
    assert still_stretch(np.full(300, np.nan), 0.1) is None
