"""A part that is certain: named although the rest of what is wrong is not told.

A plant differs from its model in several ways at once. Where the record can not say which constant is off, it may still
say for sure that a sensor reads wrong: every set of effects that comes near has that one, and without it an output
stays wrong.
"""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.assessment.verification import changes, verify
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, OutputChange, SearchResult
from adaptive_flot.discovery.verdict.judge import LARGEST_CLASS

VISIBLE = 1.4
"""An output is wrong without the part: its error is so many times its noise, so half of its square is no noise."""
REPAIRED = 0.8
"""Share of its squared error above the noise that the part removes from that output."""

Name = tuple[str, str]


def with_certain_part(problem: Problem, result: SearchResult, judged: Judgement) -> Judgement:
    """The judgement, with the part named (or told as a class) that is certain where the whole is not told.

    The part is in every alternative near the best. On the confirm split it brings one output, which is wrong without
    it, down to the noise, and makes no other one worse. So it rests on an output that the rest does not explain.
    """
    best = judged.best
    if judged.word != "abstain" or best is None or len(best.names) < 2 or not problem.whiten:
        return judged
    if result.verification is None or not result.verification.confirmed:
        return judged
    near = [best, *(a for a in result.alternatives if a is not best and judged.near(a))]
    known = dict(zip(best.names, best.known, strict=True))
    sure = [n for n in best.names if all(n in a.names for a in near)]
    part = tuple(n for n in sure if _rests_on_an_output(problem, result, best, {n}))
    if named := tuple(n for n in part if known[n]):
        return replace(judged, word="named", part=named)
    if part:
        return replace(judged, word="unnamed", part=part[:1])
    last = tuple(dict.fromkeys(a.names[-1] for a in near))
    others = {n for a in near for n in a.names[:-1]}
    if all(a.known[-1] for a in near) and len(last) <= LARGEST_CLASS and not others & set(last):
        if _rests_on_an_output(problem, result, best, set(last)):
            return replace(judged, word="class", members=last, part=(best.names[-1],))
    return judged


def _rests_on_an_output(problem: Problem, result: SearchResult, best: Alternative, part: set[Name]) -> bool:
    """Whether the best alternative without any of a part leaves an output wrong that the best one repairs."""
    without = [a for r in result.rounds for a in r.alternatives if not part & set(a.names)]
    if not without:
        return False
    rival = min(without, key=lambda a: a.fit.bic).fit
    if not verify(problem, rival, best.fit).confirmed:
        return False
    return any(_repaired(c) for c in changes(problem, rival, best.fit, "confirm"))


def _repaired(change: OutputChange) -> bool:
    wrong = change.before**2 - change.noise**2
    removed = change.before**2 - change.after**2
    return change.before > VISIBLE * change.noise and removed > REPAIRED * wrong and change.reduction95[0] > 0
