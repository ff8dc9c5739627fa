"""What the ranked alternatives of a search amount to: one of six words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.candidates.direction import listed
from adaptive_flot.discovery.candidates.dynamics import BOUNDS
from adaptive_flot.discovery.candidates.shapes.step_events import slow
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, SearchResult
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME
from adaptive_flot.greybox.effects import LATE, STATELESS_DRIVERS
from adaptive_flot.greybox.model import Model

LEAST_MARGIN = 10.0
"""Alternatives whose information criterion is worse by less are not told apart."""
MUCH = 0.1
"""Share of the error removed on fresh rows from which something is missing, though it may not be what was found."""
MOST_RIVALS = 5

Name = tuple[str, str]


def judge(result: SearchResult) -> Judgement:
    """Turn the ranked alternatives into a word.

    The margin of a name, with t rows an effective sample, and what the best alternative leaves unexplained::

        margin = max(LEAST_MARGIN t, left - left_threshold)

    An alternative is near the best where its BIC is worse by less than max(margin, SURE sd), with the standard
    deviation of the difference of their log-likelihoods (see `loglik_difference_sds`). So an alternative that is worse
    by less than the best one's own shortcoming is not told apart from it.
    """
    if not result.alternatives:
        return Judgement("none", None, (), (), LEAST_MARGIN)
    best = result.alternatives[0]
    if result.verification and not result.verification.confirmed:
        # smaller, but not surely or not everywhere: something else is the matter
        checked = result.verification
        sure = checked.reduction95[0] > 0 or checked.reduction > MUCH
        return Judgement("abstain" if sure else "none", best if sure else None, (), _others(result, best), LEAST_MARGIN)
    margin = _margin(result)
    close = [a for a in result.alternatives if a.near(best, margin)]
    close = [a for a in close if not any(_only_adds_to(a, b) for b in close)]
    named = [a for a in close if all(a.known)]
    rivals = _others(result, best)
    # a drift of what is adapted is the ordinary explanation: what is hardly better does not replace it. Where the model
    # does not say that it drifts, a ramp is a change like any other; a curve follows whatever wanders
    alike = (a for a in close if a.worse_than(best) < LEAST_MARGIN * result.rows_per_effective_sample)
    drifting = next((a for a in alike if _only_drift(a, result)), None)
    if drifting and (
        may_drift(result.base.model, result.base.names) or any(e.family.is_curve for e in drifting.effects)
    ):
        # all there is, unless something else had to be added to all
        return Judgement(
            "abstain" if result.common_nuisance else "none", drifting, (), _others(result, drifting), margin
        )
    if not named:
        return Judgement("unnamed" if len(close) == 1 else "abstain", best, (), rivals, margin)
    if named[0] is not best and not named[0].near(best, LEAST_MARGIN * result.rows_per_effective_sample):
        # what has no name is surely better than what has one, though neither is all there is
        return Judgement("abstain", best, (), rivals, margin)
    best, rivals = named[0], _others(result, named[0])
    names = tuple(dict.fromkeys(tuple(sorted(a.names)) for a in named))
    if len(names) == 1 and not same_site(best.names) and not same_signal(best.names):
        return Judgement("named", best, (), rivals, margin)
    members = tuple(dict.fromkeys(n for group in names for n in group))
    if any(a.delta_bic > -LEAST_MARGIN for a in named):  # one that explains nothing comes close: so does the best
        return Judgement("abstain", best, (), rivals, margin)
    if len(members) > LARGEST_CLASS * len(best.names):
        members = _one_way_each(members)
    if len(members) <= LARGEST_CLASS * len(best.names):
        return Judgement("class", best, members, rivals, margin)
    return Judgement("abstain", best, (), rivals, margin)


def _one_way_each(members: Sequence[Name]) -> tuple[Name, ...]:
    """The members, the best first, each part once for each way in which it may be wrong.

    A lag and a dead time look alike, and so do a limit or a floor and a bent dependence.
    """
    limited = {site for site, driver in members if driver in BOUNDS}

    def way(name: Name) -> Name:
        site, driver = name
        if driver in LATE:
            return site, "late"
        bent = driver in BOUNDS or (site in limited and driver not in STATELESS_DRIVERS)
        return site, "limited" if bent else driver

    likeliest = {way(n): n for n in reversed(members)}.values()
    return tuple(n for n in members if n in likeliest)


def same_site(names: Sequence[Name]) -> tuple[Name, ...]:
    """The names (site, driver) that share their site with another of these.

    Two dependences of one quantity are no two causes for sure: one of another shape looks the same.
    """
    sites = [site for site, _ in names]
    return tuple(n for n in names if sites.count(n[0]) > 1)


def same_signal(names: Sequence[Name]) -> tuple[Name, ...]:
    """The names (site, driver) that share a signal they depend on with another of these, at another site.

    One dependence on that signal, of a shape that the form at hand does not draw, leaves an error for the other one.
    """
    signals = [driver for _, driver in names if driver not in STATELESS_DRIVERS]
    return tuple(n for n in names if signals.count(n[1]) > 1)


def but_for_what_has_no_reason(result: SearchResult, judged: Judgement) -> Judgement:
    """The judgement, with a name taken back that has no more reason than something nameless that comes as near.

    Beside a background much is free, and a dependence of a quantity of the process looks like one of a sensor. The
    sensor has no reason for it. Neither has the quantity, where the model's table of known effects does not list it.
    """
    best = judged.best
    if judged.word != "named" or best is None or len(best.names) != 1:
        return judged
    (effect,), model = best.effects, best.fit.model
    if effect.driver in STATELESS_DRIVERS or not model.known_effects or listed(model, effect) is not None:
        return judged
    elsewhere = (a for a in result.alternatives if not all(a.known) and all(s != effect.site for s, _ in a.names))
    if any(judged.near(a) for a in elsewhere):
        return replace(judged, word="abstain", members=())
    return judged


def constants_told(judged: Judgement) -> tuple[str, ...]:
    """Sites whose constant is named, or is in the class that is told."""
    if judged.word not in WITH_A_NAME or judged.best is None:
        return ()
    told = (*(judged.part or judged.best.names), *judged.members)
    return tuple(dict.fromkeys(site for site, driver in told if driver == "constant"))


def held_up(problem: Problem, result: SearchResult, judged: Judgement) -> tuple[SearchResult, Judgement]:
    """The judgement, confirmed for what it names: a search confirms the best alternative, which may have no name."""
    best = judged.best
    if best is None or best is result.alternatives[0] or judged.word not in WITH_A_NAME or not problem.whiten:
        return result, judged
    checked = verify(problem, result.base, best.fit, best.problem)
    if checked.confirmed:
        return replace(result, verification=checked), judged
    return result, Judgement("abstain", result.alternatives[0], (), judged.rivals, judged.margin)


def first_that_stands(problem: Problem, result: SearchResult) -> SearchResult:
    """The search with the first named alternative in front that fresh rows confirm, where they contradict the best one.

    It must be as good as the best one: not told apart by evidence that counts effective samples. What fits a little
    better and makes an output worse on fresh rows is no reason to say nothing.
    """
    checked = result.verification
    if not result.alternatives or checked is None or checked.confirmed or not checked.reduction95[0] > 0:
        return result
    best = result.alternatives[0]
    for a in result.alternatives[1:]:
        if all(a.known) and problem.whiten and a.near(best, LEAST_MARGIN * result.rows_per_effective_sample):
            own = verify(problem, result.base, a.fit, a.problem)
            if own.confirmed:
                others = tuple(b for b in result.alternatives if b is not a)
                return replace(result, alternatives=(a, *others), verification=own)
    return result


def leads_by_far(result: SearchResult, judged: Judgement) -> bool:
    """Whether rivals are near the best one only for what that leaves unexplained: by its lead it is told from all."""
    best, checked = judged.best, result.verification
    if best is None or not judged.rivals or checked is None or not checked.confirmed:
        return False
    close = any(a.near(best, LEAST_MARGIN * result.rows_per_effective_sample) for a in judged.rivals)
    return not close and any(a.near(best, judged.margin) for a in judged.rivals)


def undecided_rivals(result: SearchResult) -> tuple[Alternative, ...]:
    """Rivals that are near the best, where some are so only for what the best leaves unexplained; else none."""
    if not result.alternatives or result.verification is None or not result.verification.confirmed:
        return ()
    best, margin = result.alternatives[0], _margin(result)
    near = tuple(a for a in result.alternatives[1:] if a.near(best, margin))
    return near if any(not a.near(best, LEAST_MARGIN * result.rows_per_effective_sample) for a in near) else ()


def least_separation(result: SearchResult, problem: Problem, rows: int) -> float:
    """Difference in the criterion that tells two alternatives apart in a test of so many rows.

    The margin of this record (see `judge`); what the best alternative leaves unexplained is there in a test as well, in
    proportion to its length.
    """
    unexplained = (result.left - result.left_threshold) * rows / max(int(problem.rows("estimate").sum()), 1)
    return max(LEAST_MARGIN * result.rows_per_effective_sample, unexplained)


def _margin(result: SearchResult) -> float:
    return max(LEAST_MARGIN * result.rows_per_effective_sample, result.left - result.left_threshold)


def _others(result: SearchResult, best: Alternative) -> tuple[Alternative, ...]:
    """The first few alternatives beside the best, whether they have a name or not."""
    return tuple(a for a in result.alternatives if a is not best)[:MOST_RIVALS]


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


def may_drift(model: Model, names: Sequence[str]) -> bool:
    """Whether a model says of all parameters of these names that they drift."""
    return all(p.drifts for p in model.parameters if p.name in names)


def _only_drift(a: Alternative, result: SearchResult) -> bool:
    """Whether adapted parameters that change slowly are all there is; a change at an onset is an event with a cause."""
    in_time = all(site in result.adapted_sites and driver == "time" for site, driver in a.names)
    return in_time and all(slow(e, result.slow_s) for e in a.effects)
