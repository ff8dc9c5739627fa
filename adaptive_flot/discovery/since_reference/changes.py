"""What has changed since a reference: hypotheses about the whole record first, then events, in innovations form.

The first compares free runs over hours, and finds what is the matter all the time. An event of a few rows is lost in
it, and so is a fault beside what wanders. The innovations form sees both, row by row. Before it may speak, what the
model lacks on the reference too is added to it: such a thing has not changed.

Its time grows with rows times states. A record that is too long for it is searched as without a reference instead, with
the constants held: see `searched_change`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.swings import swing_notes
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.step_length import steps_words
from adaptive_flot.discovery.hypotheses.families import EVENTS, STRUCTURE
from adaptive_flot.discovery.hypotheses.procedure import Comparison, compare
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL
from adaptive_flot.discovery.innovations.filter.thinning import is_short_since_reference
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.places.row_by_row import unless_without_a_site
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.least_shown import least_shown
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.cause import with_cause
from adaptive_flot.discovery.innovations.verdicts.event import with_event
from adaptive_flot.discovery.innovations.verdicts.rivals import unless_a_trend, unless_hardly_off
from adaptive_flot.discovery.record.screening import clean_outputs, out_of_range
from adaptive_flot.discovery.results.least_shown import what_is_hidden, what_is_shown
from adaptive_flot.discovery.results.words import NO_SITE, WITH_A_NAME
from adaptive_flot.discovery.since_reference.not_new import why_not_new
from adaptive_flot.discovery.since_reference.places import with_what_is_nearest, with_words_without_a_site
from adaptive_flot.discovery.since_reference.process_noise import Looked, with_process_noise
from adaptive_flot.discovery.since_reference.searched_change import with_searched_effect
from adaptive_flot.discovery.since_reference.step import with_step
from adaptive_flot.discovery.since_reference.supported import unless_alike, unless_unsupported
from adaptive_flot.discovery.since_reference.taken_back import (
    leaves_more,
    taken_back,
    unless_contradicted,
    unless_more_than_noise,
    unless_much_is_left,
)
from adaptive_flot.discovery.verdict.words.suspects import suspect_notes
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.parallel import one_thread

SPENT = "The budget ended before events, effects of other shapes and two effects were looked for."
NOT_ASKED = "the budget ended before it could be compared with process noise, which may explain as much"


@one_thread()
def find_changes(
    model: Model,
    records: Sequence[Dataset],
    references: Sequence[Dataset] = (),
    *,
    adapted: Sequence[str] = (),
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
    budget: float | None = None,
) -> Comparison:
    """Find what has changed since a reference, or what a model lacks in several records of one process.

    Arguments and errors are those of `compare`. `budget` is the time [s] after which nothing more is searched for; None
    for as long as it takes. Where it ends before all hypotheses of the whole record are compared, nothing is named.
    Events, and causes beside what wanders, are looked for where there are one record and a reference. What is wrong
    with the data is among the notes.
    """
    began = time.monotonic()
    ends = float("inf") if budget is None else began + budget
    compared = _found(model, records, references, adapted, processes, progress, ends)
    if not references and len(records) > 1:
        compared = unless_an_event(compared, model, records, adapted, processes, progress, ends)
    compared = _with_words_on_data(compared, model, records, bool(references))
    return replace(compared, verdict=replace(compared.verdict, seconds=time.monotonic() - began))


def _found(
    model: Model,
    records: Sequence[Dataset],
    references: Sequence[Dataset],
    adapted: Sequence[str],
    processes: int,
    progress: Callable[[str], None],
    ends: float,
) -> Comparison:
    """What has changed, without a word on the data; `ends` is the `time.monotonic` at which a budget is spent."""
    compared = compare(model, records, references, adapted=adapted, processes=processes, progress=progress, ends=ends)
    if not compared.complete:
        why = f"the budget ended before all {compared.tried} hypotheses were compared"
        return taken_back(compared, why, said="Nothing is told")
    if not references or compared.verdict.word == "insufficient":
        return compared
    if len(records) != 1:
        return unless_much_is_left(compared)
    short, left = is_short_since_reference(records[0], compared.calibration.model), ends - time.monotonic()
    judged: Comparison | None = compared
    if left <= 0:
        judged = None
    elif short:
        judged = _row_by_row(compared, records[0], references, processes, progress, ends)
    elif leaves_more(compared.verdict):
        judged = unless_more_than_noise(with_searched_effect(compared, records[0], processes, progress, left))
    confirmed = short and judged is not None
    if short and judged is not None:
        judged = _of_another_shape(judged, records[0], processes, progress, ends - time.monotonic())
    if judged is None:
        judged = replace(compared, verdict=replace(compared.verdict, notes=(*compared.verdict.notes, SPENT)))
        if short and judged.verdict.word in WITH_A_NAME:
            return taken_back(judged, NOT_ASKED)
    judged = with_step(judged, processes, ends) if short else judged
    why = why_not_new(judged, confirmed)
    return taken_back(judged, why, said="No change is told") if why else unless_much_is_left(judged)


def _row_by_row(
    compared: Comparison,
    record: Dataset,
    references: Sequence[Dataset],
    processes: int,
    progress: Callable[[str], None],
    ends: float,
) -> Comparison | None:
    """The comparison with what the innovations form tells, and without what it does not know; None without the time."""
    reference = max(references, key=len)
    with np.errstate(all="ignore"):
        known = with_process_noise(compared, record, reference, processes, progress, ends)
        if known is None:
            return None
        if known.hidden is not None:
            with_it = _with_hidden_event(compared, known.hidden)
            if with_it is not compared:
                return with_it
        search, base, told, sole, before = known.search, known.base, known.told, known.sole, known.before
        told, sole = unless_a_trend(base, told), unless_a_trend(base, sole) if sole is not None else None
        on_sites = unless_without_a_site(search, base, told)
        if search.time_is_up:
            return None
        if on_sites.word != told.word and NO_SITE in on_sites.why:
            compared = with_words_without_a_site(compared, told, on_sites.why)
        elif on_sites.word != told.word and compared.verdict.word == "abstain":
            # one more than a class may hold: what it would have been, and when, is where to look
            note = f"With process noise {on_sites.why}. {told_in_words(search, told)}"
            compared = replace(compared, verdict=replace(compared.verdict, notes=(*compared.verdict.notes, note)))
        told = unless_hardly_off(on_sites)
        with_it = compared
        if _has_event(told):
            with_it = with_event(compared, search, told)
            if with_it is compared and compared.verdict.word in ("none", "abstain"):
                # a model that lacks much may hide an event of some rows from free runs, which usually err as much
                with_it = with_cause(compared, search, base, told, before)
        elif leaves_more(compared.verdict) and not _is_structure(told):
            with_it = with_cause(compared, search, base, told, before)
            if with_it is compared and sole is not None and not _is_structure(sole):
                with_it = with_cause(compared, search, base, sole, before)
        if with_it is not compared:
            return with_it
        kept = unless_contradicted(compared, told)
        kept = kept if kept is not compared else unless_unsupported(compared, search, base, told)
        kept = kept if kept is not compared else unless_alike(compared, told)
        kept = with_what_is_nearest(kept, search, base, [told.best, *known.single])
        return _with_least_shown(kept, search, base)


def _with_hidden_event(compared: Comparison, hidden: Looked) -> Comparison:
    """The comparison with events that are told beside less noise; unchanged where an error stays above the usual one.

    Beside less noise whatever else is wrong looks like an event. So it must explain all of it.
    """
    search, base = hidden.search, hidden.base
    told = unless_hardly_off(unless_without_a_site(search, base, unless_a_trend(base, hidden.told)))
    if not _has_event(told):
        return compared
    with_it = with_event(compared, search, told)
    return with_it if all(c.after <= ABOVE_USUAL * c.noise for c in with_it.verdict.error) else compared


def _with_least_shown(compared: Comparison, search: Search, base: Explanation) -> Comparison:
    """The comparison with how small a change the record would have shown, where it shows none."""
    verdict = compared.verdict
    if verdict.word != "none":
        return compared
    found = least_shown(search.fitter(search.model, ()), base.fit)
    reason = " ".join(filter(None, (verdict.reason, what_is_hidden(found))))
    notes = (*verdict.notes, *what_is_shown(found))
    return replace(compared, verdict=replace(verdict, reason=reason, notes=notes, least_shown=found))


def _is_structure(told: Told) -> bool:
    """Whether all that is told is what a plant has or has not, and what does not come between two records of it.

    A constant that has changed looks like a dependence on whatever input has moved otherwise. Where a dependence is new
    all the same, the search of other shapes finds it.
    """
    return bool(told.effects) and all(h.kind in STRUCTURE for h in told.effects)


def unless_an_event(
    compared: Comparison,
    model: Model,
    records: Sequence[Dataset],
    adapted: Sequence[str],
    processes: int,
    progress: Callable[[str], None],
    ends: float = float("inf"),
) -> Comparison:
    """The comparison, its name taken back where the longest record alone is explained by what happened at some time.

    What begins at a time is no hypothesis for several records. A slow part or a dependence then stands in for it.
    """
    if compared.verdict.word not in WITH_A_NAME:
        return compared
    longest = max(records, key=len)
    budget = None if ends == float("inf") else max(ends - time.monotonic(), 0.0)
    alone = discover(model, longest, adapted=adapted, processes=processes, progress=progress, budget=budget).verdict
    if alone.word != "named" or not alone.effects or any(e.effect.driver != "time" for e in alone.effects):
        return compared
    said = alone.reason.partition(". ")[0]
    return taken_back(compared, f"{longest.name} alone says: {said}. Judge each record by itself", "is missing")


def _with_words_on_data(compared: Comparison, model: Model, records: Sequence[Dataset], referred: bool) -> Comparison:
    """The comparison with a word on holes, sensors that say nothing, and events that seem to begin there."""
    verdict, said = compared.verdict, [f"{note}." for note in steps_words(model, compared.calibration.model)]
    for record in records:
        _, _, suspects = clean_outputs(record, model)
        ranges = [n for q, y in zip(model.outputs, record.outputs.T, strict=True) for n in out_of_range(q, y)]
        said += [f"{record.name}: {note}." for note in (*record.notes, *ranges, *suspects)]
        if len(records) == 1:
            said += [f"{note}." for note in suspect_notes([e.effect for e in verdict.effects], suspects, record.dt)]
    if verdict.word == "abstain":
        swings = zip(compared.rows.records, compared.null.fresh, strict=True)
        said += [f"{r.name}: {n}." for r, e in swings for n in swing_notes(model, r, compared.rows.columns, e)]
    if referred and len(records) > 1:
        said.append("Events in time were not looked for: that takes one record without a gap, and a reference.")
    asked = replace(model, max_step_s=compared.calibration.model.max_step_s)  # without what was found, which has states
    if referred and len(records) == 1 and not is_short_since_reference(records[0], asked):
        said.append(f"Events in time were not looked for row by row: {len(records[0])} rows are many for this model.")
    return replace(compared, verdict=replace(verdict, notes=(*verdict.notes, *said))) if said else compared


def _of_another_shape(
    compared: Comparison, record: Dataset, processes: int, progress: Callable[[str], None], left: float
) -> Comparison:
    """What is told of a short record, in a shape that leaves no more than the reference, where it leaves much more.

    Dry friction is found at its place by a turn of a given width, which leaves fifteen times the noise of an encoder. A
    shape at another place is not taken: the search of a long record has no innovations form to contradict it.
    """
    if left <= 0 or unless_much_is_left(compared) is compared:
        return compared
    searched = with_searched_effect(compared, record, processes, progress, left)
    usual = all(c.after <= ABOVE_USUAL * c.noise for c in searched.verdict.error)
    told = searched.verdict.sites
    return searched if usual and told and told <= compared.verdict.sites else compared


def _has_event(told: Told) -> bool:
    """Whether what is told is an event, and not a thing of the whole record."""
    return told.word in WITH_A_NAME and bool(told.effects) and all(h.kind in EVENTS for h in told.effects)
