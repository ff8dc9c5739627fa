"""Protects "has changed" against what the model lacks on the reference as well: a thermometer that was always late.

The constants of a reference hide most of that, and other inputs bring it to light.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.since_reference import not_new
from adaptive_flot.discovery.since_reference.not_new import why_not_new
from adaptive_flot.greybox import Effect
from tests.discovery.hypotheses.tank import record, tank

LATE = Effect("thermometer", "lag", "lag", {"amplitude": 1.0, "time_constant": 100.0}, {"scale": 300.0})


def _named_late(compared: Comparison) -> Comparison:
    """The comparison as if a late thermometer had been named."""
    late = next(t for t in compared.tested if t.hypothesis is not None and t.hypothesis.label == "thermometer lag")
    judged = replace(compared.judged, word="named", best=late)
    return replace(compared, judged=judged, verdict=replace(compared.verdict, word="named"))


def test_what_explains_the_reference_as_well_has_not_changed() -> None:
    compared = compare(tank(), [record("new", 3, LATE)], [record("old", 2, LATE)])
    assert "explains the reference as well" in why_not_new(_named_late(compared), confirmed=True)


def test_what_the_reference_does_not_have_may_be_new() -> None:
    compared = compare(tank(), [record("new", 3, LATE)], [record("old", 2)])
    assert compared.verdict.word in ("named", "class"), compared.verdict.reason
    assert why_not_new(compared, confirmed=False) == ""
    assert why_not_new(_named_late(compared), confirmed=False) == ""


@pytest.mark.parametrize(("before", "is_new"), [(LATE, False), (None, True)])
def test_what_explains_all_records_better_has_not_changed(
    before: Effect | None, is_new: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the rule that asks the reference alone: its constants may hide there what it lacks."""
    monkeypatch.setattr(not_new, "_is_there_before", lambda compared: False)
    old = record("old", 2, before) if before else record("old", 2)
    compared = compare(tank(), [record("new", 3, LATE)], [old])
    why = why_not_new(_named_late(compared), confirmed=True)
    assert why == "" if is_new else "on all records it explains more" in why
