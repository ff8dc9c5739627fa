"""The stage in which the report rows have their say: errors before and after, and a name that they contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.beside_background import drop_beside_background, unknown_of_background
from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE, rows_per_effective_sample
from adaptive_flot.discovery.assessment.telling_rows import largest_by_chance, off_the_edges, on_telling_rows
from adaptive_flot.discovery.assessment.verification import AT_NOISE, changes
from adaptive_flot.discovery.background.fitting import taken_up
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Judgement, OutputChange, State
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME
from adaptive_flot.discovery.verdict.conclude import STILL_WRONG, report_errors
from adaptive_flot.discovery.verdict.judge import constants_told
from adaptive_flot.discovery.verdict.outputs import certain_words
from adaptive_flot.discovery.verdict.report_veto import (
    contradiction,
    contradiction_at_the_end,
    explains_little,
    last_report_rows,
    made_worse,
    noise_from_row_to_row,
    rests_on_memory,
    surely_better,
    unexplained,
    without_gain,
)
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.greybox.effects import STATELESS_DRIVERS
from adaptive_flot.greybox.model import FloatArray

FITTED = ("estimate", "confirm")
"""Splits that the last fits have seen."""


def heed_report(state: State) -> State:
    """Take a name back where the held-out rows contradict it."""
    whole, (before, after), judgement = state.known_problem, state.refitted, state.judged
    told = judgement.word in WITH_A_NAME
    problem = whole
    if told and state.report_record is None:
        problem = on_telling_rows(whole, before, after, "report", FITTED)
    beside = replace(state.problem_after or whole, splits=problem.splits)
    error = report_errors(problem, before, after, state.report_record)
    noise = noise_from_row_to_row(problem, before.model, error, state.report_record)
    unknown = limit = np.zeros(len(error))
    likelier = 0.0
    if state.report_record is None:
        names = [after.model.outputs[c].name for c in problem.columns]
        shown = [names.index(c.output) for c in error]
        unknown, limit = (v[shown] for v in unknown_of_background(beside, after, FITTED, "report"))
        if told:
            likelier = drop_beside_background(problem, before, after, "report", beside)
            likelier /= rows_per_effective_sample(problem, before, after)
    surely = likelier > LEAST_EVIDENCE
    alike = taken_up(problem, constants_told(judgement))
    remembered, few = with_memory(problem, error, noise), problem is not whole
    if few:
        remembered = remembered * _few_rows(problem, after, error)
    against = contradiction(judgement, error, remembered, limit, surely, alike, few)
    if not against and few:
        against = _worse_elsewhere(whole, state.problem_after or whole, before, after, surely)
    if not against and state.report_record is None:
        against = _at_the_end(judgement, whole, state.problem_after or whole, before, after, surely)
    if not against and told:
        against = explains_little(error, np.hypot(noise, unknown))
    if not against and told and not whole.whiten:
        against = without_gain(error, noise)
    none_near = not against and judgement.word == "class" and _many_and_none(judgement, error)
    if none_near:
        against = "several other sets of effects do about as well, and none comes near the noise"
    if against:
        judgement = replace(judgement, word="abstain", members=(), part=())
    # what they have in common is not certain either
    judged = replace(judgement, rivals=()) if none_near else judgement
    certain = certain_words(judged, error, noise) if judgement.word == "abstain" else ""
    if judgement.word == "none" and (left := unexplained(error, np.hypot(noise, unknown))):
        certain = f"{left}{_nearest_drift(judgement, error)}"
        judgement = Judgement("abstain", None, (), judgement.rivals, judgement.margin)
    elif judgement.word == "none":
        certain = rests_on_memory(error, np.hypot(noise, unknown))
    by_likelihood = likelier if surely and not against and not surely_better(error) else 0.0
    state = replace(state, error=error, judgement=judgement, contradiction=against, certain=certain)
    return replace(_with_rows_said(state, whole, problem), likelihood=by_likelihood)


def _nearest_drift(judgement: Judgement, error: Sequence[OutputChange]) -> str:
    """What is fitted and surely takes up a part of the error as it drifts, in words: the error after is that beside it.

    Without its size: a free curve goes too far where something else is the matter. With the signals on which a single
    dependence of the same site comes as near.

    Friction that grew at 7 s, which the constants of a drive follow, left a tenth of the error.
    """
    if judgement.best is None or not any(c.reduction95[0] > 0 for c in error):
        return ""
    sites = [site for site, _ in judgement.best.names]
    near = [a.names[0] for a in judgement.rivals if len(a.names) == len(sites) == 1 and judgement.near(a)]
    signals = [driver for site, driver in near if site == sites[0] and driver not in STATELESS_DRIVERS]
    moved = " and ".join(map(spaced, sites))
    depends = f", or as it depends on {' or on '.join(map(spaced, signals))}" if signals else ""
    return f" What comes nearest is a change of what is fitted: {moved}, in time{depends}."


def _many_and_none(judgement: Judgement, error: Sequence[OutputChange]) -> bool:
    """Whether a class has more sets of several effects than a reader can try, and its best leaves much.

    They then stand in for one thing that has no form here. A hysteresis was told as six sets of three effects.
    """
    assert judgement.best is not None  # a class has a best member
    sets = {frozenset(a.names) for a in (judgement.best, *judgement.rivals) if judgement.near(a)}
    several = min(len(names) for names in sets) > 1
    return (
        not judgement.part
        and several
        and len(sets) > LARGEST_CLASS
        and any(c.after > STILL_WRONG * c.noise for c in error)
    )


def _few_rows(problem: Problem, after: Fit, error: Sequence[OutputChange]) -> FloatArray:
    """Factors (m,) by which noise may be larger by chance on few rows than on many, where that counts as noise."""
    names = [after.model.outputs[c].name for c in problem.columns]
    largest = largest_by_chance(after.noise, int(problem.rows("report").sum()))
    return np.maximum(largest[[names.index(c.output) for c in error]] / AT_NOISE, 1.0)


def _worse_elsewhere(whole: Problem, beside: Problem, before: Fit, after: Fit, likelier: bool) -> str:
    """What all report rows say against a pulse, but those that could not know when it came."""
    there = off_the_edges(whole, after, "report", FITTED)
    error = changes(there, before, after, "report")
    noise = with_memory(there, error, noise_from_row_to_row(there, before.model, error))
    names = [after.model.outputs[c].name for c in whole.columns]
    limit = unknown_of_background(replace(beside, splits=there.splits), after, FITTED, "report")[1]
    return made_worse(error, noise, limit[[names.index(c.output) for c in error]], likelier)


def _at_the_end(
    judgement: Judgement, problem: Problem, beside: Problem, before: Fit, after: Fit, likelier: bool
) -> str:
    """What the last report rows say against a free curve in time at a sensor; `beside` is the problem of `after`."""
    last = last_report_rows(problem)
    error = changes(last, before, after, "report")
    names = [after.model.outputs[c].name for c in problem.columns]
    noise = with_memory(last, error, noise_from_row_to_row(last, before.model, error))
    if not likelier:
        return contradiction_at_the_end(judgement, error, noise)
    own = replace(beside, splits=last.splits)
    limit = unknown_of_background(own, after, FITTED, "report")[1]
    return contradiction_at_the_end(judgement, error, noise, limit[[names.index(c.output) for c in error]])


def _with_rows_said(state: State, whole: Problem, problem: Problem) -> State:
    """The state with a note where the errors are those of some held-out rows only."""
    if problem is whole:
        return state
    some, of = (int(p.rows("report").sum()) for p in (problem, whole))
    said = f"the errors before and after are those on the {some} of {of} held-out rows that the event touches"
    return replace(state, screening=replace(state.screening, notes=(*state.screening.notes, said)))


def with_memory(problem: Problem, error: Sequence[OutputChange], noise: FloatArray) -> FloatArray:
    """The noise of each output; beside a background with the memory that the fit gives it, where that is more.

    Differences from row to row show sqrt(1 - rho) of noise whose neighbours have a correlation rho. An output at its
    noise would be wrong then, whichever name is told. Without a background, noise with a memory may be what is missing.
    """
    return noise if problem.background is None else np.maximum(noise, [c.noise for c in error])
