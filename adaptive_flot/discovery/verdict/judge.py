"""What the ranked alternatives of a search amount to: one of six words."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.candidates.step_events import slow
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, SearchResult
from adaptive_flot.greybox.effects import STATELESS_DRIVERS

LEAST_MARGIN = 10.0
"""Alternatives whose information criterion is worse by less are not told apart."""
MUCH = 0.1
"""Share of the error removed on fresh rows from which something is missing, though it may not be what was found."""
LARGEST_CLASS = 3
MOST_RIVALS = 5


def judge(found: SearchResult) -> Judgement:
    """Turn the ranked alternatives into a word.

    The margin of a name, with t rows an effective sample, and what the best alternative leaves unexplained::

        margin = max(LEAST_MARGIN t, left - left_threshold)

    An alternative is near the best where its BIC is worse by less than max(margin, SURE sd), with the standard
    deviation of the difference of their log-likelihoods (see `loglik_difference_sds`). So an alternative that is worse
    by less than the best one's own shortcoming is not told apart from it.
    """
    if not found.alternatives:
        return Judgement("none", None, (), (), LEAST_MARGIN)
    best = found.alternatives[0]
    if found.verification and not found.verification.confirmed:
        # smaller, but not surely or not everywhere: something else is the matter
        checked = found.verification
        sure = checked.reduction95[0] > 0 or checked.reduction > MUCH
        return Judgement("abstain" if sure else "none", best if sure else None, (), _others(found, best), LEAST_MARGIN)
    margin = _margin(found)
    close = [a for a in found.alternatives if a.near(best, margin)]
    close = [a for a in close if not any(_only_adds_to(a, b) for b in close)]
    named = [a for a in close if all(a.known)]
    rivals = _others(found, best)
    # a drift of what is adapted is the ordinary explanation: what is hardly better does not replace it
    alike = (a for a in close if a.worse_than(best) < LEAST_MARGIN * found.rows_per_effective_sample)
    drifting = next((a for a in alike if _only_drift(a, found)), None)
    if drifting:  # all there is, unless something else had to be added to all
        return Judgement("abstain" if found.common_nuisance else "none", drifting, (), _others(found, drifting), margin)
    if not named:
        return Judgement("unnamed" if len(close) == 1 else "abstain", best, (), rivals, margin)
    if named[0] is not best and not named[0].near(best, LEAST_MARGIN * found.rows_per_effective_sample):
        # what has no name is surely better than what has one, though neither is all there is
        return Judgement("abstain", best, (), rivals, margin)
    best, rivals = named[0], _others(found, named[0])
    names = tuple(dict.fromkeys(tuple(sorted(a.names)) for a in named))
    if len(names) == 1:
        return Judgement("named", best, (), rivals, margin)
    members = tuple(dict.fromkeys(n for group in names for n in group))
    if any(a.delta_bic > -LEAST_MARGIN for a in named):  # one that explains nothing comes close: so does the best
        return Judgement("abstain", best, (), rivals, margin)
    if len(members) <= LARGEST_CLASS * len(best.names):
        return Judgement("class", best, members, rivals, margin)
    return Judgement("abstain", best, (), rivals, margin)


def held_up(problem: Problem, found: SearchResult, judged: Judgement) -> tuple[SearchResult, Judgement]:
    """The judgement, confirmed for what it names: a search confirms the best alternative, which may have no name."""
    best = judged.best
    if best is None or best is found.alternatives[0] or judged.word not in ("named", "class") or not problem.whiten:
        return found, judged
    checked = verify(problem, found.base, best.fit)
    if checked.confirmed:
        return replace(found, verification=checked), judged
    return found, Judgement("abstain", found.alternatives[0], (), judged.rivals, judged.margin)


def undecided_rivals(found: SearchResult) -> tuple[Alternative, ...]:
    """Rivals that are near the best, where some are so only for what the best leaves unexplained; else none."""
    if not found.alternatives or found.verification is None or not found.verification.confirmed:
        return ()
    best, margin = found.alternatives[0], _margin(found)
    near = tuple(a for a in found.alternatives[1:] if a.near(best, margin))
    return near if any(not a.near(best, LEAST_MARGIN * found.rows_per_effective_sample) for a in near) else ()


def _margin(found: SearchResult) -> float:
    return max(LEAST_MARGIN * found.rows_per_effective_sample, found.left - found.left_threshold)


def _others(found: SearchResult, best: Alternative) -> tuple[Alternative, ...]:
    """The first few alternatives beside the best, whether they have a name or not."""
    return tuple(a for a in found.alternatives if a is not best)[:MOST_RIVALS]


def _only_adds_to(a: Alternative, b: Alternative) -> bool:
    """Whether `a` makes a constant change of `b` depend on a signal, for no gain in likelihood to speak of.

    The dependence holds the constant as a special case: no record and no test can tell it from there.
    """
    if len(a.names) != len(b.names):
        return False
    other = [(x, y) for x, y in zip(sorted(a.names), sorted(b.names), strict=True) if x != y]
    if len(other) != 1:
        return False
    (site, driver), (where, constant) = other[0]
    signal = driver not in STATELESS_DRIVERS
    return site == where and constant == "constant" and signal and b.fit.loss - a.fit.loss < LEAST_MARGIN


def _only_drift(a: Alternative, found: SearchResult) -> bool:
    """Whether adapted parameters that change slowly are all there is; a change at an onset is an event with a cause."""
    in_time = all(site in found.adapted_sites and driver == "time" for site, driver in a.names)
    return in_time and all(slow(e, found.slow_s) for e in a.effects)
