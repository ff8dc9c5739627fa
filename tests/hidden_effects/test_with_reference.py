"""Protects: records with a reference are the same at any time, and the reference has no effect."""

from __future__ import annotations

import pandas as pd

from benchmarks.with_reference.record import entry_of, make_record


def test_three_of_four_records_have_an_effect() -> None:
    assert [entry_of(47, k) is None for k in range(8)] == [False, False, False, True] * 2


def test_a_record_is_always_the_same_and_has_an_answer() -> None:
    first, again = make_record(47, 5), make_record(47, 5)
    pd.testing.assert_frame_equal(first.new, again.new)
    pd.testing.assert_frame_equal(first.reference, again.reference)
    assert [(e["site"], e["driver"]) for e in first.answer["effects"]] == [("air_flow", "constant")]
    assert not first.new["concentrate_grade"].equals(first.reference["concentrate_grade"])
