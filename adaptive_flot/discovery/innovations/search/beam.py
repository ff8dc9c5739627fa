"""The explanations of a record, found effect by effect: each by a regression, and then refitted.

A second effect is looked for beside each of the best first ones, not only beside the best: what is missing besides
decides which of two names is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.hypotheses.families import EVENTS, SWITCHED
from adaptive_flot.discovery.innovations.screening import Screened, Screening
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation, distinct, worth
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.search.turned_over import with_events_turned_over
from adaptive_flot.parallel import parallel_map

REFITTED, SAME_SITE = 6, 2
"""Suspects that are refitted, and of these at one site: causes of the whole record, and events."""
LAGS_ELSEWHERE = 3
"""Sites whose lag or dead time is refitted besides."""
HALTS = 2
"""Parts that are stuck for a time, which are refitted besides."""
BEAM = 3
"""Explanations that are carried on."""
MOST_EFFECTS = 2
CONSTANT = ("gain", "offset")
"""Kinds of a constant change: a fit may start far from it, so that a regression on the model as it is overlooks it."""


def best_explanations(
    search: Search, base: Explanation, progress: Callable[[str], None] = lambda stage: None
) -> list[Explanation]:
    """All explanations that were refitted, the best first; the model as it is among them."""
    found, beam, best = [base], [base], base
    for count in range(1, MOST_EFFECTS + 1):
        if search.time_is_up:
            break
        progress(f"innovations form: explanations of {count} effect{'s' if count > 1 else ''}")
        further = distinct([e for start in beam for e in _further(search, start)])
        if count > 1:
            best_few = parallel_map(search.settled, further[: 2 * BEAM], search.processes)
            further = distinct([*best_few, *further[2 * BEAM :]])
        ranked = distinct(with_events_turned_over(search, further))
        if count > 1:
            found += events_alone(search, ranked[:BEAM])
        found += ranked
        if not ranked or ranked[0].criterion < best.criterion + LEAST_GAIN:
            break
        beam, best = ranked[:BEAM], ranked[0]
    return sorted(distinct(found), key=lambda e: -worth(e))


def events_alone(search: Search, pairs: Sequence[Explanation]) -> list[Explanation]:
    """The event of each pair with one, without the other effect: its times may be better than those it had alone.

    An event that starts while constants make up for it may rest at a wrong time. A partner of no size then lets it
    go to the right one, and two effects would be told for one.
    """
    found = []
    for pair in pairs:
        others = [h for h in pair.hypotheses if h.kind not in EVENTS]
        if len(pair.hypotheses) == 2 and len(others) == 1:
            found.append(search.without(pair, others[0]))
    return [e for e in found if np.isfinite(e.fit.log_likelihood)]


def _further(search: Search, start: Explanation) -> list[Explanation]:
    """The explanation with one more effect, for each that is worth its numbers."""
    if search.time_is_up:
        return []
    screening, screened = screened_beside(search, start)
    first = not start.hypotheses
    refits = search.all_with(start, _spread(screened, both_forms=first))
    if search.since_reference and first:
        held = held_at_the_reference(search, start)
        _, beside = screened_beside(search, held)
        constant = [s for s in beside if s.suspect.hypothesis.kind in CONSTANT and s.gain >= LEAST_GAIN]
        spread = [s for s in _spread(beside, first) if not any(s is c for c in constant)]
        refits += search.all_with(start, [*spread, *constant], held)
    switched = [e for e in refits if e.hypotheses[-1].kind in SWITCHED]
    if switched:
        switch = max(switched, key=lambda e: e.criterion).hypotheses[-1]
        there = [s for site in search.model.sites for s in screening.at_times_of(switch, site)]
        refits += search.all_with(start, there)
    return refits


def held_at_the_reference(search: Search, start: Explanation) -> Explanation:
    """The model as it is with the constants of the reference, and the noise of a fit to this record."""
    p, fit = search.model.parameter_values, start.fit
    return replace(start, fit=replace(fit, p=p, filtered=search.fitter(search.model, ()).run(p, fit.noise)))


def screened_beside(search: Search, start: Explanation) -> tuple[Screening, list[Screened]]:
    """The regressions on an explanation, and what may be found by them, the best first."""
    screening = search.screening(start, [s.name for s in search.model.sites])
    # one course in time at most: a second one would draw whatever is left
    events = all(h.driver != "time" for h in start.hypotheses) and search.may("switch")
    screened = screening.all(events=events, ramps=events and search.since_reference)
    return screening, [s for s in screened if search.may(s.suspect.hypothesis.kind)]


def _spread(ranked: Sequence[Screened], both_forms: bool) -> list[Screened]:
    """The best few, one of a kind and few at one site; the best store, which most models leave out; what is hidden.

    Process noise follows what a lag does, and the filter what a sensor shows that has stopped. A regression says little
    of either. Nor does it tell a lag from a dead time: both are refitted where `both_forms`.
    """
    chosen: list[Screened] = []
    for s in ranked:
        h = s.suspect.hypothesis
        same = [c.suspect.hypothesis for c in chosen if c.suspect.hypothesis.site == h.site]
        alike = [c for c in same if (c.kind in EVENTS) == (h.kind in EVENTS)]  # an event takes no place of a cause
        if s.gain > 0 and len(alike) < SAME_SITE and all((c.kind, c.driver) != (h.kind, h.driver) for c in same):
            chosen.append(s)
        if len(chosen) == REFITTED:
            break
    stores = [s for s in ranked if s.suspect.hypothesis.kind == "store" and s.gain >= LEAST_GAIN]
    further = [] if any(s in chosen for s in stores) else stores[:1]
    halts = [s for s in ranked if s.suspect.hypothesis.kind == "stuck for a time" and s.gain >= LEAST_GAIN]
    further += [s for s in halts[:HALTS] if s not in chosen]
    return [*chosen, *further, *_late(ranked, chosen, both_forms)]


def _late(ranked: Sequence[Screened], chosen: Sequence[Screened], both_forms: bool) -> list[Screened]:
    """The best lag or dead time of each of a few sites, or both, that is not among what is refitted already."""
    late: dict[tuple[str, str], Screened] = {}
    for s in ranked:
        h = s.suspect.hypothesis
        if h.kind == "lag" and s.gain > 0:
            late.setdefault((h.site, h.driver if both_forms else ""), s)
    further = [s for s in late.values() if s not in chosen]
    sites = list(dict.fromkeys(s.suspect.hypothesis.site for s in further))[:LAGS_ELSEWHERE]
    return [s for s in further if s.suspect.hypothesis.site in sites]
