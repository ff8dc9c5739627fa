"""A second opinion, in innovations form, on records that the free run does not explain.

A free run with measurement noise alone has no place for what always wanders in a real process. So it bends that into an
effect. Where the best alternative leaves an error far above the noise from row to row, its name is not believed before
the innovations form has been asked.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.hypotheses.families import EVENTS
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.filter.thinning import searchable
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.late import late_where
from adaptive_flot.discovery.innovations.places.row_by_row import unless_without_a_site
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.pauses import with_pauses_closed
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.alternatives import among_alternatives
from adaptive_flot.discovery.innovations.verdicts.common import one_that_all_have
from adaptive_flot.discovery.innovations.verdicts.in_time import or_in_time
from adaptive_flot.discovery.innovations.verdicts.rivals import (
    follows_time,
    late_as_well,
    leaves_too_much,
    not_two,
    one_of_them_drifts,
    unconfirmed,
    unless_a_trend,
    unless_hardly_off,
    unless_it_wanders,
)
from adaptive_flot.discovery.innovations.verdicts.telling import kept, taken_back, tell, with_note
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import NO_SITE, ONE_CAUSE, TELLING, WITH_A_NAME
from adaptive_flot.discovery.verdict.large_drift import unexpected_drift


def second_opinion(state: State) -> State:
    """Ask the innovations form where the free run leaves too much, and keep only what both allow.

    It is asked where nothing has a name, where held-out rows contradict what had one, where a free curve in time has
    one, where what is fitted drifts, where much was found and not confirmed, and where too much is left. What it names
    takes the place of the free run's verdict, where the report rows do not contradict it. A name of the free run that
    it does not know is taken back, and so is a curve without a name.

    Two errors on the report rows may contradict it. That of a free run over the record must not surely grow. Where it
    does not surely fall, or the free run has a free curve in time for a rival, that over stretches must (see
    `errors_over_stretches`). A curve in time follows what wanders, so that no other cause has a smaller error.
    """
    if one_of_them_drifts(state):  # row by row a change of what is fitted may be told from the others of a class
        drift = replace(state, judgement=replace(state.judged, word="abstain", members=(), part=()))
        alone = second_opinion(drift)
        best = alone.judged.best if alone.judged.word in WITH_A_NAME else None
        of_them = {site for site, _ in state.judged.members}
        return alone if best is not None and {site for site, _ in best.names} <= of_them else state
    problem, (before, _) = state.known_problem, state.refitted
    given = replace(problem.record, initial_state=before.initial_state)
    asked_for = is_asked(state)
    record = searchable(given, before.model) if asked_for else None
    if record is None:
        return state
    if time.monotonic() > state.ends:
        return _not_asked(state)
    state.progress("ask the innovations form")
    start = {q.name: q.value for q in state.model.parameters}
    search = Search(
        before.model,
        record,
        problem.columns,
        noise_floor([problem.record], problem.columns),
        problem.adapted,
        processes=state.processes,
        as_given=tuple(start[name] for name in problem.adapted),
        ends=state.ends,
    )
    with np.errstate(all="ignore"):
        base = search.base(before.model.parameter_values)
        found = with_pauses_closed(search, best_explanations(search, base, state.progress))
        if search.time_is_up:
            return _not_asked(state)
        first = one_that_all_have(state, search, base, found, judge(search, base, found))
        told = _by_the_rules(state, search, base, first)
        on_sites = unless_without_a_site(search, base, told)
        if told.word == "abstain" and any(h.kind in EVENTS for h in first.effects):
            # an event that no part explains by itself may be one where the model has no site
            elsewhere = unless_without_a_site(search, base, first)
            on_sites = elsewhere if NO_SITE in elsewhere.why else on_sites
        if search.time_is_up:
            return _not_asked(state)
    if NO_SITE in on_sites.why:
        state = replace(state, without_a_site=on_sites.why)
    if ONE_CAUSE in state.contradiction:  # an opinion on one of several places would be none on what acts at all
        return state
    told = unless_hardly_off(on_sites)
    if told.word in TELLING:
        asked = tell(state, search, base, told)
    else:
        asked = _with_both(kept(state, told), search, first)
    if asked.judged.word in TELLING or time.monotonic() > state.ends:
        return asked
    with np.errstate(all="ignore"):
        among = among_alternatives(state, search, base, found)
        if among is not None:  # what a balance explains better is not told by this way either
            among = unless_hardly_off(unless_without_a_site(search, base, _by_the_rules(state, search, base, among)))
    if among is None or among.word not in TELLING:
        return asked
    return tell(state, search, base, among, among=True)


def _with_both(state: State, search: Search, first: Told) -> State:
    """The state with a note on two effects that explain a record best together, and are not told (see `not_two`).

    Of a class the second is one of those that are open.
    """
    needed = len(first.certain) + (first.word == "class")
    if state.judged.word != "abstain" or first.word not in WITH_A_NAME or needed != 2:
        return state
    words = told_in_words(search, first).rstrip(".")
    said = "with process noise two effects together are best, which more often stand in for a third thing"
    return with_note(state, f"{said}: {words}")


def _by_the_rules(state: State, search: Search, base: Explanation, told: Told) -> Told:
    """What is told, without what stands in for something else more often than not (see `rivals`)."""
    told = not_two(search, base, late_where(search, told, lambda _, site: late_as_well(state, told, site)))
    return or_in_time(search, base, unless_a_trend(base, unless_it_wanders(search, base, told)))


def is_asked(state: State) -> bool:
    """Whether the free run leaves something open (see `second_opinion`)."""
    silent = state.judged.word in ("abstain", "unnamed")
    return silent or follows_time(state) or unexpected_drift(state) or unconfirmed(state) or leaves_too_much(state)


def _not_asked(state: State) -> State:
    """The verdict where a budget was spent before the innovations form could be asked: no name that it may deny."""
    if state.judged.word not in TELLING:
        return state
    return taken_back(state, "the time ended before it could be compared with process noise, which may explain as much")
