"""What the innovations form tells, as a verdict: where its free run, or its error over stretches, bears it out.

Else the verdict of the free run is kept, less sure of what the innovations form does not know.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.verification import AT_NOISE
from adaptive_flot.discovery.candidates.catalogue import nameable
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.hypotheses.families import EVENTS
from adaptive_flot.discovery.innovations.filter.thinning import searchable
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.alternatives import beside_alternatives
from adaptive_flot.discovery.innovations.verdicts.common import in_all_that_is_near
from adaptive_flot.discovery.innovations.verdicts.members import alternative, others
from adaptive_flot.discovery.innovations.verdicts.reach import outputs_in_reach
from adaptive_flot.discovery.innovations.verdicts.rivals import (
    allowed_ratio,
    but_for_what_wanders,
    competes,
    follows_time,
    hardly_explained,
    smaller,
    surely_better,
    surely_worse,
    two_and_more,
)
from adaptive_flot.discovery.innovations.verdicts.stretches import errors_over_folds, errors_over_stretches, is_on
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, OutputChange, State, Word
from adaptive_flot.discovery.results.words import NO_SITE, TELLING, WITH_A_NAME, rough
from adaptive_flot.discovery.verdict.conclude import report_errors
from adaptive_flot.discovery.verdict.large_drift import unexpected_drift
from adaptive_flot.discovery.verdict.report_veto import contradiction, noise_from_row_to_row
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.discovery.verdict.words.wording import beside_a_part
from adaptive_flot.greybox.model import Model


def tell(state: State, search: Search, base: Explanation, told: Told, among: bool = False) -> State:
    """The verdict of the innovations form, with a free run of the extended model beside that of the plain one.

    Where alternatives of the free run were `among` what it has judged, none of these competes with it.
    """
    problem, (before, _) = state.known_problem, state.refitted
    after = _free_run(state, search, told.best, before)
    if after is None:
        return kept(state, told)
    best = alternative(told.best, after, before, told.best)
    names = best.names
    judgement = _judgement(state, told, best)
    error = report_errors(problem, before, after, state.report_record)
    noise = noise_from_row_to_row(problem, before.model, error, state.report_record)
    against = contradiction(judgement, error, noise)
    wanders = but_for_what_wanders(state, names)
    follows = competes(state) and follows_time(state) and not wanders
    asked = bool(against or follows) and not surely_worse(error, noise)
    over = _over_stretches(state, search, base, told.best) if asked else ()
    stands = bool(over) and not contradiction(judgement, over, noise) and _better_than_as_it_is(over, error)
    reached = outputs_in_reach(before.model, after.model)  # a sensor stands in for nothing elsewhere
    shown = tuple(c for c in (over if stands else error) if c.output in reached)
    falls_short = hardly_explained(shown) or two_and_more(told, shown)
    if (against and not stands) or falls_short or _another_drift(state, told):
        without = kept(state, told)
        return _with_hint(without, search, told) if without.judged.word == "abstain" else without
    less = smaller(error, state.error, allowed_ratio(state, names))
    beside = wanders or in_all_that_is_near(state, names)  # what has more beside it leaves less, and is no other cause
    if competes(state) and not (among or beside) and not (stands and follows) and not less:
        both = beside_alternatives(state, search, base, told)
        if both is None:
            return kept(state, told) if names_one_of(state.judged, told) else taken_back(state, _other_name(told))
        told = with_what_stood_beside(both, told)
        judgement = _judgement(state, told, best)
    _, result = state.searched
    left = any(c.after > AT_NOISE * s for c, s in zip(error, noise, strict=True) if s > 0)
    members = [e for e, _ in told.open]
    rivals = others(told.best, members, lambda e: _free_run(state, search, e, before), before)
    # members are near by what the innovations form has compared, whatever the difference of their criteria
    return replace(
        state,
        search=replace(result, alternatives=(best, *rivals), verification=None),
        judgement=replace(judgement, rivals=rivals, margin=max((a.worse_than(best) + 1 for a in rivals), default=0.0)),
        after=after,
        sizes=after.with_sizes(*search.sizes(told.best)),
        error=error,
        contradiction="",
        certain=beside_a_part(replace(state.judged, part=names)).rstrip() if beside and left else "",
        sentence=told_in_words(search, told) + (_over_words(over, problem) if stands else ""),
    )


def kept(state: State, told: Told) -> State:
    """The verdict where the innovations form tells nothing: less sure of a name, of a curve without one, of `none`.

    Several effects may stand in for one that acts where the model has no site: rain was told as four of them.
    """
    judgement = state.judged
    if not _knows(told, judgement):
        return taken_back(state, f"with process noise it is not confirmed: {told.why or 'other effects explain more'}")
    several = judgement.best is not None and len(judgement.best.names) > 1
    if judgement.word in WITH_A_NAME and several and NO_SITE in told.why:
        return taken_back(state, f"with process noise it is {told.why}")
    if judgement.word in WITH_A_NAME and follows_time(state):
        return taken_back(state, "a free curve in time follows anything: it predicts nothing that it was not fitted to")
    if judgement.word == "none" and told.word != "none" and not surely_better(state):
        why = told.why or f"held-out rows do not confirm what fits best with process noise ({_words(told)})"
        return replace(
            state,
            judgement=replace(judgement, word="abstain"),
            sentence=f"Something is missing, but the record does not say what: {_times_noise(state)}, and {why}.",
        )
    return state


def taken_back(state: State, why: str) -> State:
    """The state with `abstain` for its word, and why."""
    judgement = replace(state.judged, word="abstain", members=())
    return replace(state, judgement=judgement, contradiction=why)


def with_note(state: State, said: str) -> State:
    """The state with a note more."""
    return replace(state, screening=replace(state.screening, notes=(*state.screening.notes, said)))


def _with_hint(state: State, search: Search, told: Told) -> State:
    """The state with a note on what the innovations form would tell, where held-out rows do not confirm it.

    It says where to look, and is no verdict: only one part by itself is told so.
    """
    if told.word != "named" or len(told.certain) != 1 or told.beside:
        return state
    words = told_in_words(search, told).rstrip(".")
    return with_note(state, f"with process noise one explanation is best, and free runs do not confirm it: {words}")


def _times_noise(state: State) -> str:
    """How far errors on the report rows are above the noise from row to row, in words."""
    most = max((c.after / c.noise for c in state.error if c.noise > 0), default=0.0)
    return f"the error is up to {rough(most)} times the noise from row to row" if most >= 1.05 else "little is left"


def _knows(told: Told, judgement: Judgement) -> bool:
    """Whether a name is at sites of the best explanations; a curve without a name must be one of their effects."""
    if judgement.best is None:
        return True
    if judgement.word == "unnamed":
        found = {(h.site, h.driver) for e in told.alike for h in e.hypotheses}
        return set(judgement.best.names) <= found
    return judgement.word != "named" or {site for site, _ in judgement.best.names} <= told.sites


def names_one_of(judgement: Judgement, told: Told) -> bool:
    """Whether what the innovations form names is at a site of what the free run tells, or that tells nothing."""
    if judgement.word not in TELLING or judgement.best is None:
        return True
    said = judgement.members if judgement.word == "class" else judgement.best.names
    return bool({site for site, _ in said} & {h.site for h in told.effects})


def _other_name(told: Told) -> str:
    return f"with process noise another cause explains more: {_words(told)}"


def _words(told: Told) -> str:
    return " or ".join(h.label for h in told.effects)


def with_what_stood_beside(both: Told, before: Told) -> Told:
    """What is told beside alternatives, with what had explained as much where the model has no site.

    Not where a part is certain, and one of others open: the place stood beside that part.
    """
    is_part = both.word == "class" and bool(both.certain)
    return both if before.beside is None or is_part else replace(both, beside=before.beside)


def _judgement(state: State, told: Told, best: Alternative) -> Judgement:
    """The word for what is told: as in free runs, a dependence that its site has no reason for has no name."""
    nameless = not all(_is_nameable(state.model, *name) for name in best.names)
    several = bool(told.open or told.beside)  # what is certain is in all of them
    members = tuple((h.site, h.driver) for h in told.effects) if several else ()
    members += ((told.beside.place, told.beside.driver),) if told.beside else ()
    word: Word = "class" if told.word != "named" or told.beside else "unnamed" if nameless else "named"
    return Judgement(word, best, members, (), 0.0)


def _is_nameable(model: Model, name: str, driver: str) -> bool:
    return nameable(model, next(site for site in model.sites if site.name == name), driver)


def _another_drift(state: State, told: Told) -> bool:
    """Whether a drift of what is fitted surely helps on the report rows, and what is told is elsewhere."""
    best = state.judged.best
    if best is None or not (unexpected_drift(state) and surely_better(state)):
        return False
    return not {site for site, _ in best.names} <= {h.site for h in told.effects}


def _better_than_as_it_is(over: tuple[OutputChange, ...], error: tuple[OutputChange, ...]) -> bool:
    """Whether errors over stretches with what is told are below those of a free run of the model as it is.

    By the geometric mean over the outputs. From the state of a filter, a model that errs by noise alone may predict
    worse than without any: what is better then is no more than a filter that is less wrong.
    """
    plain = tuple(replace(c, after=c.before) for c in error)
    return smaller(over, plain, 1.0)


def _over_stretches(state: State, search: Search, base: Explanation, best: Explanation) -> tuple[OutputChange, ...]:
    """Errors over the stretches of the report split, or of a record of its own that reports.

    Over all rows, each held out once, where an event is not on in those: they can not tell whether it is there.
    """
    problem = state.known_problem
    held_out = np.isin(search.record.time, problem.record.time[problem.rows("report")])
    report = state.report_record
    on = is_on(best, search.record.time) if any(h.kind in EVENTS for h in best.hypotheses) else held_out
    if on.any() and not (on & held_out).any():
        return errors_over_folds(search, base, best)
    report = searchable(report, search.model) if report is not None else None
    if report is None and not held_out.any():
        return ()
    return errors_over_stretches(search, base, best, held_out, report)


def _over_words(changes: tuple[OutputChange, ...], problem: Problem) -> str:
    """Errors over stretches, and why those of free runs may be alike: a course may take an event up."""
    said = ", ".join(c.words for c in changes)
    words = f" Error on held-out stretches, each predicted from the filter's state before it: {said}."
    if problem.background is None or problem.background.course is None:
        return words
    site = spaced(problem.background.course.site)
    return f"{words} Both free runs have a {site} that wanders, which may take the event up."


def _free_run(state: State, search: Search, explanation: Explanation, before: Fit) -> Fit | None:
    """The model with the effects of an explanation, fitted to all rows but the report split, from its own values."""
    problem = replace(state.known_problem, nodes=None)
    model = search.model_of(explanation)
    fitter = Fitter(problem, ("estimate", "confirm"))
    start = {p.name: p.value for p in model.parameters}
    fit = fitter.fit(model, explanation.free, start, like=before, rounds=2)
    return None if fit is None else fitter.with_intervals(fit)
