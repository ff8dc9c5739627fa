"""A part that is certain: named although the rest of what is wrong is not told.

A plant differs from its model in several ways at once. Where the record can not say which constant is off, it may still
say for sure that a sensor reads wrong: every set of effects that comes near has that one, and without it an output
stays wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from adaptive_flot.discovery.assessment.likelihood import loglik_difference_sds
from adaptive_flot.discovery.assessment.verification import changes, verify
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, OutputChange, SearchResult, Verification
from adaptive_flot.discovery.results.words import LARGEST_CLASS
from adaptive_flot.discovery.verdict.judge import LEAST_MARGIN, MOST_RIVALS, Name, same_signal, same_site

VISIBLE = 1.4
"""An output is wrong without the part: its error is so many times its noise, so half of its square is no noise."""
REPAIRED = 0.8
"""Share of its squared error above the noise that the part removes from that output."""


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
    part = tuple(n for n in _in_all(near) if _rests_on_an_output(problem, result, best, {n}))
    if named := tuple(n for n in part if known[n]):
        return replace(judged, word="named", part=named)
    if part:
        return replace(judged, word="unnamed", part=part[:1])
    for members in _one_of_each(near):
        if _rests_on_an_output(problem, result, best, set(members)):
            return replace(judged, word="class", members=members, part=(members[0],))
    return judged


def part_alone(problem: Problem, result: SearchResult, judged: Judgement) -> tuple[Judgement, Verification] | None:
    """The effect that may be named alone where a set of effects is not told, and its verification; None for no such.

    It is surely the best of the single effects, and every set that comes near the best one has it. What else is off
    stays open, so sets count as near by LEAST_MARGIN and SURE alone (see `judge`), not by what the best one lacks. The
    effect must be known by name, and as a model of its own surely better than none on the confirm split.
    """
    best, singles = judged.best, result.rounds[0].alternatives
    if judged.word != "abstain" or best is None or len(best.names) < 2 or not problem.whiten or not singles:
        return None
    part, margin = singles[0], LEAST_MARGIN * result.rows_per_effective_sample
    sds = loglik_difference_sds(problem, part.fit, [a.fit for a in singles])
    rivals = [replace(a, loglik_difference_sd=sd) for a, sd in zip(singles[1:], sds[1:], strict=True)]
    near = near_by_least_margin(result, best)
    if not all(part.known) or part.names[0] not in _in_all(near) or any(a.near(part, margin) for a in rivals):
        return None
    checked = verify(problem, result.base, part.fit, part.problem)
    if not checked.confirmed:
        return None
    return Judgement("named", part, (), tuple(rivals[:MOST_RIVALS]), margin), checked


def near_by_least_margin(result: SearchResult, best: Alternative) -> list[Alternative]:
    """The best set of effects and those near it, by LEAST_MARGIN and SURE alone, where what else is off stays open."""
    margin = LEAST_MARGIN * result.rows_per_effective_sample
    return [best, *(a for a in result.alternatives if a is not best and a.near(best, margin))]


def _in_all(near: Sequence[Alternative]) -> list[Name]:
    """Names of the first set that all have, but for two dependences of or on one quantity: these are no two causes."""
    best, twice = near[0], (*same_site(near[0].names), *same_signal(near[0].names))
    return [n for n in best.names if all(n in a.names for a in near) and n not in twice]


def _one_of_each(near: Sequence[Alternative]) -> Iterator[tuple[Name, ...]]:
    """The smallest groups of names of which every set has just one, that of the first set in front.

    One stands for another: beside the same rest, a set with each is near. Groups whose names never meet the same rest
    are put together by chance.
    """
    names = tuple(dict.fromkeys(n for a in near for n, known in zip(a.names, a.known, strict=True) if known))
    sets = [set(a.names) for a in near]
    for size in range(2, LARGEST_CLASS + 1):
        for members in combinations(names, size):
            group = set(members)
            if all(len(group & s) == 1 for s in sets) and _interchangeable(group, sets):
                yield tuple(sorted(members, key=lambda n: n not in near[0].names))


def _interchangeable(group: set[Name], sets: Sequence[set[Name]]) -> bool:
    """Whether a walk from set to set, that changes one member of the group for another, meets all of them."""
    rests = [(s & group, s - group) for s in sets]
    reached, before = {*rests[0][0]}, set[Name]()
    while reached != before:
        before = set(reached)
        beside = [rest for own, rest in rests if own <= before]
        reached |= {n for own, rest in rests if rest in beside for n in own}
    return reached == group


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
