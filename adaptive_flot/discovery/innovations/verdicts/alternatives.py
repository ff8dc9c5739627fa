"""What the innovations form tells, beside what the free run has and does not tell: both in innovations form.

A curve of a few values leaves the smaller error of a free run, because it bends after what wanders. And a curve in what
drives an actuator can draw the limit of that. So alternatives of the free run are fitted with process noise as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME
from adaptive_flot.greybox.effects import STATELESS_DRIVERS

COMPARED = 6
"""Alternatives of the free run that are fitted, the best ones."""


def beside_alternatives(state: State, search: Search, base: Explanation, told: Told) -> Told | None:
    """What is told, as a class with each alternative of the free run that explains about as much.

    Parameters
    ----------
    state
        Its judgement tells nothing.
    search, base, told
        The innovations form, and what it tells.

    Returns
    -------
    Told or None
        None where an alternative elsewhere explains more, where one can not be fitted, where one that explains about as
        much has several effects, and where more sites are left than a class may hold. Where one at the same site
        explains more, a curve that bends after what else is wrong, both are a class, unless both depend on one signal.
    """
    if state.judged.word != "abstain" or state.contradiction:
        return None
    _, result = state.searched
    found = [search.of_effects(a.effects, a.fit.model, a.fit.names) for a in result.alternatives[:COMPARED]]
    fitted = [e for e in found if e is not None]
    alike = [e for e in fitted if not told_apart(search, base, told.best, e)]
    own = [h for h in told.effects if h.kind != "store"]  # a store beside a fault is what the model leaves out anyway
    better = [e for e in alike if told_apart(search, base, e, told.best)]
    if len(fitted) < len(found) or any(not _alone_at(e, own) for e in better):
        return None
    otherwise = [e for e in better if not _one_dependence((*own, *e.hypotheses))]
    if otherwise and told.word == "named":  # it is that part, and how it is off is not told
        (curve,) = otherwise[0].hypotheses
        return replace(
            told, word="class", certain=(), open=((told.best, own[0]), (otherwise[0], curve)), alike=(told.best, *alike)
        )
    if better and told.word == "named":  # another form of the same dependence: others are near that, or are not
        best = max(better, key=lambda e: e.criterion)
        alike = [e for e in fitted if not told_apart(search, base, best, e)]
    others = [(e, h) for e in alike for h in e.hypotheses if h.site not in {h.site for h in own}]
    if not others:
        return told
    sites = {h.site for h in own} | {h.site for _, h in others}
    if told.word != "named" or len(own) != 1 or any(len(e.hypotheses) > 1 for e in alike) or len(sites) > LARGEST_CLASS:
        return None
    members = {h.site: (e, h) for e, h in reversed(others)}
    opened = ((told.best, own[0]), *sorted(members.values(), key=lambda m: -m[0].criterion))
    return replace(told, word="class", certain=(), open=opened, alike=(told.best, *alike))


def among_alternatives(
    state: State, search: Search, base: Explanation, found: Sequence[Explanation]
) -> Told | None:  # fmt: skip
    """What is told with the effects of the free run among the explanations, where one of those is the best.

    The free run does not tell them apart, and process noise may: it knows what else moves the outputs.

    Parameters
    ----------
    state
        Its judgement tells nothing.
    search, base, found
        The innovations form, and its own explanations.

    Returns
    -------
    Told or None
        None where an alternative has several effects or can not be fitted, where one that explains about as much as the
        best is a free curve in time, and where nothing is told.
    """
    _, result = state.searched
    compared = result.alternatives[:COMPARED]
    if state.judged.word != "abstain" or state.contradiction or any(len(a.names) > 1 for a in compared):
        return None
    fitted = [search.of_effects(a.effects, a.fit.model, a.fit.names) for a in compared]
    best_of = {_name(e): e for e in sorted([*found, *(e for e in fitted if e is not None)], key=lambda e: e.criterion)}
    told = judge(search, base, sorted(best_of.values(), key=lambda e: -e.criterion))
    alike = [h.effect for e in told.alike for h in e.hypotheses]
    if None in fitted or told.best not in fitted or any(e.driver == "time" and e.family.is_curve for e in alike):
        return None
    return told if told.word in WITH_A_NAME else None


def _name(explanation: Explanation) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((h.site, h.driver) for h in explanation.hypotheses))


def _one_dependence(hypotheses: Sequence[Hypothesis]) -> bool:
    """Whether all are forms of one dependence on a signal."""
    first = hypotheses[0]
    return first.driver not in STATELESS_DRIVERS and all(
        (h.site, h.driver) == (first.site, first.driver) for h in hypotheses
    )


def _alone_at(explanation: Explanation, own: Sequence[Hypothesis]) -> bool:
    """Whether an explanation has one effect, and at the only site of what is told."""
    effects = explanation.hypotheses
    return len(own) == 1 and len(effects) == 1 and effects[0].site == own[0].site
