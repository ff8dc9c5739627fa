"""A dependence on what moves slowly, beside a change in time at the same site.

A catalyst loses a third of its activity in the middle of a record, and the hall was 7 K cooler by the end: "the rate
depends on the room temperature" fits, and is wrong. Without a reference gradual changes are not looked for, since what
wanders is full of them. But a dependence must beat the best one at its own site. Else it is open which of both it is.
"""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import WITH_A_NAME

DEPENDENCES = ("depends", "turns")


def or_in_time(search: Search, base: Explanation, told: Told) -> Told:
    """What is told; a dependence as a class with a gradual change at its site, where that explains about as much.

    Parameters
    ----------
    search, base
        The search, and the model as it is.
    told
        What was judged. A class whose members are dependences says already that it is open.
    """
    found = [h for h in told.certain if h.kind in DEPENDENCES]
    if told.word not in WITH_A_NAME or len(found) != 1:
        return told
    (told_one,) = found
    rest = base if len(told.best.hypotheses) == 1 else search.without(told.best, told_one)
    site = next(s for s in search.model.sites if s.name == told_one.site)
    ramp = search.screening(rest, [site.name]).ramp(site)
    rivals = search.all_with(rest, [ramp]) if ramp is not None else []
    if not rivals or told_apart(search, base, told.best, rivals[0]):
        return told
    certain = tuple(h for h in told.certain if h is not told_one)
    either = ((told.best, told_one), (rivals[0], rivals[0].hypotheses[-1]))
    return replace(told, word="class", certain=certain, open=either, alike=(*told.alike, rivals[0]))
