"""The answer of the discovery report: the verdict and the sizes that belong to it."""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.charts.units import amount
from adaptive_flot.discovery.results.evidence import OutputChange
from adaptive_flot.report.kit.parts import Fact
from adaptive_flot.report.kit.wording import number, spaced

MOST_FACTS = 4
"""Outputs whose errors are told at the top: those whose error fell most, in units of their noise."""
WORDS = {
    "none": "the model explains the record",
    "named": "one effect stands out",
    "class": "a few effects can not be told apart",
    "unnamed": "a curve without a name",
    "insufficient": "the record says too little",
    "abstain": "nothing can be told for sure",
}


def error_facts(changes: Sequence[OutputChange]) -> list[Fact]:
    """Error of the free run of the outputs that changed most, before and after."""
    ranked = sorted(changes, key=lambda c: -(c.before - c.after) / max(c.noise, 1e-300))
    moved = [c for c in ranked if round(100 * _share(c)) != 0]
    if not moved and ranked:
        return [Fact("Error of each output", "unchanged", "nothing was added to the model")]
    return [_error_fact(c) for c in moved[:MOST_FACTS]]


def _share(c: OutputChange) -> float:
    """Share of the error that is gone."""
    return 1 - c.after / c.before if c.before > 0 else 0.0


def _error_fact(c: OutputChange) -> Fact:
    share = 100 * _share(c)
    low, high = (number(100 * r, ".0f") for r in c.reduction95)
    note = f"{amount(c.before, c.unit)} to {amount(c.after, c.unit)}; 95 %: {low} to {high} %"
    word = "less" if share > 0 else "more"
    return Fact(f"Error of {spaced(c.output)}", f"{abs(share):.0f} % {word}", note, "good" if share > 0 else "bad")
