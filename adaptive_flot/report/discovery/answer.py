"""The answer of the discovery report: the verdict and the sizes that belong to it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.discovery.results.evidence import OutputChange
from adaptive_flot.discovery.results.verdict import Verdict
from adaptive_flot.discovery.results.words import DRIFTS
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.provenance import values_hash
from adaptive_flot.report.kit.parts import Fact
from adaptive_flot.report.kit.wording import capital, number, spaced

LACKS_A_SITE = re.compile(r"Something [a-z ]+(\. It is|,) as if ")
"""How the reason of an abstention begins that says where the model lacks a site."""
MOST_FACTS = 4
"""Outputs whose errors are told at the top: those whose error fell most, in units of their noise."""
LEAST_SHARE = 0.01
"""Share of an error below which its change is not told at the top."""
WORDS = {
    "none": "the model explains the record",
    "named": "one effect stands out",
    "class": "a few effects can not be told apart",
    "unnamed": "a curve without a name",
    "insufficient": "the record says too little",
    "abstain": "nothing can be told for sure",
}


def title_of(verdict: Verdict, titles: Mapping[str, str]) -> str:
    """The title for the word of a verdict; where a reason begins with what acts without a site, or with a drift, that.

    Not where that is one of several in the text.
    """
    if verdict.word == "abstain" and LACKS_A_SITE.match(verdict.reason):
        return "Something acts where the model has no site"
    if verdict.word == "abstain" and verdict.reason.startswith(DRIFTS):
        return "Something changes with time, and its cause is not sure"
    return capital(titles[verdict.word])


def word_in_words(verdict: Verdict) -> str:
    """What the word of a verdict says."""
    count = len(verdict.effects)
    return f"{count} effects stand out" if verdict.word == "named" and count > 1 else WORDS[verdict.word]


def error_facts(changes: Sequence[OutputChange]) -> list[Fact]:
    """Error of the free run of the outputs that surely changed, before and after, the most first."""
    ranked = sorted(changes, key=lambda c: -(c.before - c.after) / max(c.noise, 1e-300))
    moved = [c for c in ranked if (c.reduction95[0] > 0 or c.reduction95[1] < 0) and abs(_share(c)) >= LEAST_SHARE]
    if not moved and ranked:
        return [Fact("Error of each output", "no sure change", "between the model as it is and the best one found")]
    return [_error_fact(c) for c in moved[:MOST_FACTS]]


def _share(c: OutputChange) -> float:
    """Share of the error that is gone."""
    return 1 - c.after / c.before if c.before > 0 else 0.0


def _error_fact(c: OutputChange) -> Fact:
    share = 100 * _share(c)
    low, high = (number(100 * r, ".0f") for r in c.reduction95)
    power = exponent(np.array([c.before, c.after]))
    before, after = (number(v * 10.0**-power, ".3g") for v in (c.before, c.after))
    unit = unit_text(c.unit, power).removesuffix("–")
    note = f"{before} to {after} {'× ' if power else ''}{unit}".rstrip() + f"; 95 %: {low} to {high} %"
    word = "less" if share > 0 else "more"
    return Fact(f"Error of {spaced(c.output)}", f"{abs(share):.0f} % {word}", note, "good" if share > 0 else "bad")


def made_from(model: str, seconds: float, records: Sequence[Dataset]) -> list[tuple[str, str]]:
    """Lines of the foot: model, time taken, and a hash of the values that were judged."""
    data = values_hash(array for r in records for array in (r.time, r.inputs, r.outputs))
    return [("Model", model), ("Time", f"{seconds:.1f} s"), ("SHA-256 of the values read", data)]
