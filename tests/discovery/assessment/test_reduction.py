"""The reduction of an error: a case with a known answer, and how often chance alone passes for a difference."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.assessment.reduction import reduction

BLOCK, ROWS, OUTPUTS = 20, 800, 5


def test_an_error_that_is_halved_in_every_row_is_halved_for_certain() -> None:
    old = np.random.default_rng(0).chisquare(1, ROWS)
    smaller, interval = reduction(old, old / 4, BLOCK)
    assert (smaller, *interval) == pytest.approx((0.5, 0.5, 0.5))


def test_missing_rows_and_rows_too_few_to_tell_are_no_evidence() -> None:
    old = np.random.default_rng(0).chisquare(1, ROWS)
    new = old / 4
    holes = np.where(np.arange(ROWS) % 3 == 0, np.nan, old)
    assert reduction(holes, new, BLOCK)[0] == pytest.approx(0.5)
    assert reduction(old[:15], new[:15], BLOCK) == (0.0, (float("-inf"), float("inf")))


def test_of_five_outputs_one_looks_worse_by_chance_no_more_often_than_of_one() -> None:
    """Two fits that are equally good: by chance one is surely worse in 2.5 % of records, however many outputs."""
    rng = np.random.default_rng(1)
    records, alone, together = 150, 0, 0
    for _ in range(records):
        pairs = [(rng.chisquare(1, ROWS), rng.chisquare(1, ROWS)) for _ in range(OUTPUTS)]
        alone += any(reduction(old, new, BLOCK)[1][1] < 0 for old, new in pairs)
        together += any(reduction(old, new, BLOCK, OUTPUTS)[1][1] < 0 for old, new in pairs)
    assert together / records < 0.06 < alone / records
