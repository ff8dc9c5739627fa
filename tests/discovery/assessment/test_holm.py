"""Holm's procedure rejects what the one of statsmodels rejects."""

from __future__ import annotations

import numpy as np
import pytest
from statsmodels.stats.multitest import multipletests

from adaptive_flot.discovery.assessment.holm import holm

LEVEL = 0.05
STEPS = [0.0, *(LEVEL / left for left in (4, 3, 2, 1)), *(1.01 * LEVEL / left for left in (4, 3, 2, 1)), 0.3, 1.0]
"""P values at and just above the steps of the procedure for up to four tests."""


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (2, 1), (4, 2), (4, 3), (4, 4), (9, 5)])
def test_it_rejects_what_statsmodels_rejects(count: int, seed: int) -> None:
    """In any order and with ties."""
    p_values = list(np.random.default_rng(seed).choice(STEPS, count))
    expected = multipletests(p_values, alpha=LEVEL, method="holm")[0]
    assert list(holm(dict(enumerate(p_values)), LEVEL).values()) == list(expected)


def test_a_test_that_could_not_be_made_rejects_nothing_and_counts() -> None:
    assert holm({"a": 0.02, "b": float("nan"), "c": 0.01}, LEVEL) == {"a": True, "b": False, "c": True}
    assert holm({"a": 0.04, "b": float("nan")}, LEVEL) == {"a": False, "b": False}
    assert holm({}, LEVEL) == {}
