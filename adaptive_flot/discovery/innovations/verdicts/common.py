"""An effect that every explanation has, with process noise and without: told alone where the rest stays open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.verdict.certain_part import near_by_least_margin

Names = Sequence[tuple[str, str]]


def in_all_that_is_near(state: State, names: Names) -> bool:
    """Whether the free run tells nothing, and each set of effects near its best has these, and more.

    What else there is stays open: see `near_by_least_margin`.
    """
    best = state.judged.best
    if state.judged.word != "abstain" or state.contradiction or best is None:
        return False
    _, result = state.searched
    return all(set(names) < set(a.names) for a in near_by_least_margin(result, best))


def one_that_all_have(
    state: State, search: Search, base: Explanation, found: Sequence[Explanation], told: Told
) -> Told:  # fmt: skip
    """One of two effects that are named, alone, where it is in all that is near in either form; else what is told.

    Two effects are needed, and the second may stand in for what else is wrong. The first does not, where no
    explanation without it is as good as it alone.

    Parameters
    ----------
    state
        The free run's judgement.
    search, base, found, told
        The innovations form: all explanations that were compared, and what it tells.
    """
    if told.word != "named" or len(told.certain) != 2:
        return told
    for h, other in (told.certain, told.certain[::-1]):
        if h.kind == "store" or not in_all_that_is_near(state, [(h.site, h.driver)]):
            continue
        alone, without = search.without(told.best, other), search.without(told.best, h)
        rest = [e for e in found if all((g.site, g.driver) != (h.site, h.driver) for g in e.hypotheses)]
        if all(told_apart(search, base, alone, e) for e in (without, *rest)):
            return replace(told, best=alone, certain=(h,), alike=(alone,))
    return told
