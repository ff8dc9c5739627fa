"""What the stages come to: plain data that everybody may read, and that imports no stage of the search.

Map
---
words.py         The words of a verdict.
evidence.py      Of residual tests, of the comparison of two fits, and of first-order scores.
least_shown.py   Of how small a change a record shows.
alternatives.py  Of a search: fitted alternatives, rounds, and the judgement on them.
experiment.py    Of the design of a test.
verdict.py       Of a discovery: the verdict, its named effects, and all of the above.
state.py         What the stages of `discover` hand on.
"""

from adaptive_flot.discovery.results.alternatives import (
    SURE,
    Alternative,
    FirstRound,
    Judgement,
    Round,
    SearchResult,
)
from adaptive_flot.discovery.results.evidence import Detection, Location, OutputChange, Place, Symptom, Verification
from adaptive_flot.discovery.results.experiment import WATCHING, Experiment, Pair, Tried
from adaptive_flot.discovery.results.least_shown import LeastShown
from adaptive_flot.discovery.results.state import State
from adaptive_flot.discovery.results.verdict import Discovery, NamedEffect, Verdict
from adaptive_flot.discovery.results.words import LARGEST_CLASS, TELLING, WITH_A_NAME, Word

__all__ = [
    "LARGEST_CLASS",
    "SURE",
    "TELLING",
    "WATCHING",
    "WITH_A_NAME",
    "Alternative",
    "Detection",
    "Discovery",
    "Experiment",
    "FirstRound",
    "Judgement",
    "LeastShown",
    "Location",
    "NamedEffect",
    "OutputChange",
    "Pair",
    "Place",
    "Round",
    "SearchResult",
    "State",
    "Symptom",
    "Tried",
    "Verdict",
    "Verification",
    "Word",
]
