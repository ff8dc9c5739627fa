"""A record that does not start at rest, where the model assumes so, gets a word; one that does gets none."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.steady.assumed_start import wrong_start
from tests.greybox.test_model_checks import box


def _record(initial_state: float | None = None) -> Dataset:
    power = np.full((60, 1), 2.0)
    state = None if initial_state is None else np.array([initial_state])
    return Dataset("record", np.arange(60.0), 1.0, power, np.zeros((60, 1)), initial_state=state)


def test_a_start_on_the_move_is_told_with_the_state_and_what_to_set() -> None:
    """At rest the warmth is power / k = 2 K."""
    said = wrong_start(box(), _record(), np.array([5.0]), np.array([1.0]), [0], np.array([0.1]))
    assert len(said) == 1 and "warmth 5 instead of 2 K" in said[0] and "starts_steady=False" in said[0]


def test_nothing_is_said_where_the_start_is_at_rest_known_or_not_assumed() -> None:
    at_rest, away, p, noise = np.array([2.0]), np.array([5.0]), np.array([1.0]), np.array([0.1])
    assert wrong_start(box(), _record(), at_rest, p, [0], noise) == ()
    assert wrong_start(box(), _record(5.0), away, p, [0], noise) == ()
    assert wrong_start(box(starts_steady=False), _record(), away, p, [0], noise) == ()


def test_a_process_without_a_steady_state_is_told_so() -> None:
    """With k = 0 the box warms for ever."""
    said = wrong_start(box(), _record(), np.array([5.0]), np.array([0.0]), [0], np.array([0.1]))
    assert len(said) == 1 and "no steady state" in said[0]
