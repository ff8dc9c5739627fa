"""Protects: "too many alternatives explain it about as well" is said only where they do.

A best alternative may be told from all others by its lead, and not be told for what it leaves unexplained.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from adaptive_flot.discovery.verdict.judge import leads_by_far
from adaptive_flot.discovery.verdict.words.wording import reason_words


def _fake(lead: float, margin: float, confirmed: bool = True) -> tuple[SimpleNamespace, SimpleNamespace]:
    """A search and its judgement: the best alternative leads its only rival by `lead`, and `margin` is asked for."""

    def near(best: object, least: float) -> bool:
        return lead < least

    best = SimpleNamespace(names=(("heat_loss", "fan_speed"),), known=(True,), effects=())
    rival = SimpleNamespace(names=(("heater", "constant"),), known=(True,), effects=(), near=near)
    checked = SimpleNamespace(confirmed=confirmed, reduction95=(20.0, 40.0))
    result = SimpleNamespace(
        verification=checked, rows_per_effective_sample=1.0, rounds=(SimpleNamespace(compared=True),)
    )
    judged = SimpleNamespace(word="abstain", best=best, rivals=(rival,), margin=margin, members=(), part=())
    return result, judged


@pytest.mark.parametrize(
    ("lead", "margin", "confirmed", "by_far"),
    [
        (300.0, 1000.0, True, True),  # what is left asks for more than the lead
        (3.0, 1000.0, True, False),  # the rival explains as much
        (300.0, 100.0, True, False),  # nothing asks for more
        (300.0, 1000.0, False, False),  # held-out rows did not confirm the best one
    ],
)
def test_what_is_said_of_rivals_is_so(lead: float, margin: float, confirmed: bool, by_far: bool) -> None:
    result, judged = _fake(lead, margin, confirmed)
    assert leads_by_far(result, judged) == by_far  # type: ignore[arg-type]
    said = reason_words(judged, result, (), (), "", ())  # type: ignore[arg-type]
    assert ("fits the record best by far" in said) == by_far
    assert ("too many alternatives explain it about as well" in said) != by_far
    assert "heat loss" in said.replace("_", " ")
