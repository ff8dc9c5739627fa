"""What the innovations form tells at a site, beside what acts where the model has none: see `further_sites.places`.

A probe that shows 15 % less for an hour, and fresh water that nobody measures, look alike to a model that has a site
for the first alone. Their edges differ: what a sensor shows changes at once, and a basin takes its time. So before an
event is told, one is tried at each further place, at its times and at times of its own. What swings is compared with a
wave there, and another cause of the whole record with a constant change.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.further_sites.places import further_sites, is_possible, with_further_sites
from adaptive_flot.discovery.further_sites.same_meaning import is_meant, is_same_part
from adaptive_flot.discovery.further_sites.wording import as_if, change_in_words, too_many
from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.judgement import WithoutSite
from adaptive_flot.discovery.hypotheses.seen import AT_REST
from adaptive_flot.discovery.hypotheses.wording import cycle_times
from adaptive_flot.discovery.innovations.given_up import wanders
from adaptive_flot.discovery.innovations.screening import Screened, Screening
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME, in_seconds
from adaptive_flot.greybox.scope import Site


def unless_without_a_site(search: Search, base: Explanation, told: Told) -> Told:
    """What is told; nothing where the record tells it from a better explanation without a site, see `Told.beside`.

    An event, and a cause of the whole record. Without a reference, free constants make up for much of a constant change
    at such a place: it then explains no more than the model as it is.

    Parameters
    ----------
    search, base
        The search, and the model as it is.
    told
        What was judged.
    """
    event = next((h for h in told.best.hypotheses if h.kind in EVENTS), None)
    cause = told.effects[0] if told.effects else None
    left_out = event if event is not None else cause
    if told.word not in WITH_A_NAME or left_out not in told.best.hypotheses:
        return told
    further = replace(search, model=with_further_sites(search.model))
    rest = base if len(told.best.hypotheses) == 1 else search.without(told.best, left_out)
    sites = {h.site for h in told.best.hypotheses}
    places = [
        s for s in further_sites(further.model) if not any(is_same_part(search.model, s.name, site) for site in sites)
    ]
    period = _period(search, told.best, left_out)
    screening = further.screening(rest, [s.name for s in places])
    found = further.all_with(rest, [s for site in places for s in _at(screening, site, left_out, period)])
    changes = ((e, *change_at(further, e)) for e in found)
    possible = (e for e, at, by in changes if is_possible(search.model, search.record, at, by, screening.seen(at)))
    rivals = sorted(possible, key=lambda e: -e.criterion)
    if not rivals:
        return told
    if told_apart(further, base, rivals[0], told.best):
        event = rivals[0].hypotheses[-1]
        if event.kind == "switch" and wanders(further, rivals[0], event, rivals[0].criterion - rest.criterion):
            why = f"{event.site} changes about as much at other times, so that it wanders"
            return replace(told, word="abstain", certain=(), open=(), why=why)
        near = best_of_each(e for e in rivals if e is rivals[0] or not told_apart(further, base, rivals[0], e))
        return replace(told, word="abstain", certain=(), open=(), why=as_if([words_at(further, e) for e in near]))
    # where a part rests, what it gives has no factor: an amount there is the part's own
    resting = [h for h in told.effects if _is_amount_beside_a_factor(further, h) and _rests(further, rest, h)]
    is_open = len({h.site for h in told.effects}) > 1  # what does the same as a member of a class adds nothing to it

    def adds(e: Explanation) -> bool:
        place = e.hypotheses[-1].site
        return not any(
            is_meant(further.model, h.effect, place, does_the_same=is_open or h in resting) for h in told.effects
        )

    others = [e for e in rivals if adds(e)]
    one_of_them = told.word == "named" or not told.certain
    if not one_of_them or not others or told_apart(further, base, told.best, others[0]):
        return told
    if len(told.open) >= LARGEST_CLASS:
        why = too_many(len(told.open), words_at(further, others[0]))
        return replace(told, word="abstain", certain=(), open=(), why=why)
    beside = others[0].hypotheses[-1]
    return replace(told, beside=WithoutSite(beside.site, beside.driver, words_at(further, others[0])))


def _is_amount_beside_a_factor(further: Search, h: Hypothesis) -> bool:
    return h.effect.mode == "offset" and next(s for s in further.model.sites if s.name == h.site).mode == "factor"


def _rests(further: Search, rest: Explanation, h: Hypothesis) -> bool:
    """Whether a part is at rest in most of the rows in which an event is there: people who are counted as none."""
    value, time = np.abs(further.screening(rest, [h.site]).seen(h.site)), further.record.time[1:]
    inside = np.any([(time > a) & (time <= a + long) for a, long in h.pulses], axis=0) if h.pulses else np.array(False)
    return bool(inside.any() and np.median(value[inside]) <= AT_REST * value.max())


def best_of_each(found: Iterable[Explanation]) -> list[Explanation]:
    """The best explanation of each place, the best first."""
    kept: dict[str, Explanation] = {}
    for e in found:
        kept.setdefault(e.hypotheses[-1].site, e)
    return list(kept.values())


def _period(search: Search, explanation: Explanation, h: Hypothesis) -> float | None:
    """The period of an effect that repeats itself [s]."""
    return search.coefficient(explanation, h, "period") if h.kind in ("periodic", "cycle") else None


def _at(screening: Screening, site: Site, told: Hypothesis, period: float | None) -> Sequence[Screened]:
    """What may act at a further site as what is told does at its own; `period` [s] is that of what repeats itself."""
    if told.kind == "periodic":
        found = [screening.swing(site, period)]
    elif told.kind == "cycle":
        found = [screening.cycle(site, period=period)]
    elif told.kind == "ramp":
        found = [screening.ramp(site)]
    elif told.kind in EVENTS:
        found = [*screening.at_times_of(told, site), screening.switch(site)]
    else:
        return screening.constant(site)
    return [s for s in found if s is not None]


def change_at(further: Search, explanation: Explanation) -> tuple[str, float]:
    """The place of an explanation, and its amount there; the amplitude of what swings."""
    h = explanation.hypotheses[-1]
    if h.kind == "periodic":
        return h.site, math.hypot(*(further.coefficient(explanation, h, n) for n in ("sine", "cosine")))
    return h.site, further.coefficient(explanation, h, "amplitude")


def words_at(further: Search, explanation: Explanation) -> str:
    """In words what acts where and when; how much, where the constants are known by which a rate is measured."""
    h, (place, amount) = explanation.hypotheses[-1], change_at(further, explanation)
    when = ", ".join(f"from {a:.0f} s on" if long >= FOREVER else f"{a:.0f}-{a + long:.0f} s" for a, long in h.pulses)
    if h.kind == "periodic":
        when = f"up and down every {in_seconds(further.coefficient(explanation, h, 'period'))} s"
    if h.kind == "cycle":
        when = cycle_times(h.effect)
    measured = further.known is not None and not further.known.up_to_a_factor()
    return change_in_words(further.model, place, amount, when, measured)
