"""Where a lag may be: lags in a row commute, so that what an input does through them tells nothing of their order."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import LARGEST_CLASS

SAME_LAG = 0.8
"""Share of the gain from which a lag at another place is not told apart."""
SAME_DEAD_TIME = 0.4
"""The same of a dead time. What wanders in a process is as likely before it as behind it, but the filter has a chain of
lags for it, which smooths what wanders: a tank whose gauge is late keeps 56 % of the gain by its pump there."""


def late_anywhere(search: Search, base: Explanation, told: Told) -> Told:
    """A lag or a dead time that is named, as a class with each other place where it explains about as much."""
    dead_time = any(h.kind == "lag" and h.driver == "delay" for h in told.certain)
    least = (SAME_DEAD_TIME if dead_time else SAME_LAG) * (told.best.criterion - base.criterion)
    return late_where(search, told, lambda e, _: e.criterion - base.criterion >= least)


def late_where(search: Search, told: Told, alike: Callable[[Explanation, str], bool]) -> Told:
    """A lag that is named, as a class with each other place where it may be as well.

    Lags in a row commute: what an input does through them is the same in any order. Only what wanders within the
    process tells the order, and how it wanders is an assumption of the filter.

    Parameters
    ----------
    search, told
        What the innovations form says.
    alike
        Whether the explanation with the lag at another site, which is given, is about as good.
    """
    late = [h for h in told.certain if h.kind == "lag"]
    if told.word != "named" or len(late) != 1:
        return told
    others = [e for e in search.late_elsewhere(told.best, late[0]) if alike(e, e.hypotheses[-1].site)]
    if not others:
        return told
    found = sorted([told.best, *others], key=lambda e: -e.criterion)
    members = tuple((e, next(h for h in e.hypotheses if h.kind == "lag")) for e in found)
    if len(members) > LARGEST_CLASS:
        why = f"a lag explains about as much at any of {len(members)} places"
        return Told("abstain", found[0], (), (), tuple(found), why)
    certain = tuple(h for h in told.certain if h is not late[0])
    return Told("class", found[0], certain, members, tuple(found), "")


def late_somewhere(search: Search, base: Explanation, alike: Sequence[Explanation]) -> Told | None:
    """A lag whose place is open, where it explains alone about as much as the best; None where it does not.

    Every explanation that the record does not tell from the best one has to have such a lag, somewhere: that something
    is late is certain then. What else there is beside it at other places is open.
    """
    alone = next((e for e in alike if len(e.hypotheses) == 1 and e.hypotheses[0].kind == "lag"), None)
    if alone is None:
        return None
    own = alone.hypotheses[0]
    late = [(e, [h for h in e.hypotheses if (h.kind, h.driver) == (own.kind, own.driver)]) for e in alike]
    if not all(lags for _, lags in late):
        return None
    told = late_anywhere(search, base, Told("named", alone, (own,), (), (alone,), ""))
    if told.word == "abstain":
        return None
    members = {h.site: (e, h) for e, h in (told.open or ((alone, own),))}
    for e, lags in late:
        for h in lags:
            members.setdefault(h.site, (e, h))
    if not 2 <= len(members) <= LARGEST_CLASS:
        return None
    return Told("class", told.best, (), tuple(members.values()), tuple(alike), "")
