"""An effect that adds nothing to the others is not told beside them."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, SearchResult
from adaptive_flot.discovery.verdict.judge import LEAST_MARGIN, judge


def without_idle_effects(problem: Problem, result: SearchResult, judged: Judgement) -> tuple[SearchResult, Judgement]:
    """The judgement of an earlier round, where what is told is no better than some of its effects alone.

    The best set of a round is better than that of the round before, but a set without a name, or one that fresh rows
    contradict, gives way to another one. That one need not be: with effects A and B it is told where::

        BIC(A, B) < BIC(A) - LEAST_MARGIN
    """
    best = judged.best
    if judged.word not in ("named", "class") or best is None or len(best.names) < 2 or best.adjusted_bic is not None:
        return result, judged
    for earlier in result.rounds:
        alone = next((a for a in earlier.alternatives if _does_as_well(a, best)), None)
        if alone is not None and all(alone.known):
            first = earlier.alternatives[0]
            checked = verify(problem, result.base, first.fit, first.problem)
            fewer = replace(result, alternatives=earlier.alternatives, verification=checked)
            return fewer, judge(fewer)
    return result, judged


def _does_as_well(a: Alternative, best: Alternative) -> bool:
    """Whether some of the effects of the best come within a margin of it."""
    return set(a.names) < set(best.names) and a.adjusted_bic is None and a.fit.bic <= best.fit.bic + LEAST_MARGIN
