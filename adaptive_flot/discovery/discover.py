"""Discover: a record and a model in, a verdict out. `STAGES` is the whole procedure, in its order."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fallbacks import tell_part_alone, try_as_course
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.step_length import steps_for, steps_words
from adaptive_flot.discovery.innovations.places.constants import with_constants_alike
from adaptive_flot.discovery.innovations.places.free_run import compare_with_what_has_no_site
from adaptive_flot.discovery.innovations.search.least_shown import tell_least_shown
from adaptive_flot.discovery.innovations.verdicts.second_opinion import second_opinion
from adaptive_flot.discovery.later_inputs import with_later_inputs
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import Discovery, State, Verdict
from adaptive_flot.discovery.results.words import TELLING
from adaptive_flot.discovery.stages import (
    NOT_ALL_TRIED,
    allow_for_background,
    check_explained,
    check_sufficient,
    compare_with_common_nuisance,
    examine_residual,
    fit_model_as_it_is,
    fit_single_effects,
    fit_without_report,
    judge_alternatives,
    look_for_courses,
    plan_test,
    screen_record,
    search_at_once,
    search_one_by_one,
    split_rows,
    tell_background,
)
from adaptive_flot.discovery.test_design.signals import input_range
from adaptive_flot.discovery.verdict.at_noise import none_at_noise
from adaptive_flot.discovery.verdict.conclude import STILL_WRONG, conclude
from adaptive_flot.discovery.verdict.heed_report import heed_report
from adaptive_flot.discovery.verdict.large_drift import heed_large_drift
from adaptive_flot.discovery.verdict.one_course import heed_one_course
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.parallel import one_thread

SEARCH_SHARE = 0.7
"""Share of a budget that the search may take; the rest is for the last fits, the report and the proposed test."""
MOST_AGAIN = 3
"""How often a search is begun again, in shorter steps or with inputs moved by a row: what it has found asks for it."""


@one_thread()
@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # a run that leaves all bounds is no fit
def discover(
    model: Model,
    record: Dataset,
    *,
    adapted: Sequence[str] = (),
    report_record: Dataset | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    processes: int = 1,
    budget: float | None = None,
    referred: bool = False,
    progress: Callable[[str], None] = lambda stage: None,
) -> Discovery:
    """Find what physical effect a model lacks, from a measured record.

    Parameters
    ----------
    model
        The model, with sites; its parameters of role "estimated" are free in every alternative.
    record
        Measured record, from `read_dataset`.
    adapted
        Names of the free parameters instead of those of role "estimated".
    report_record
        A further record of the same process that starts in the same (unknown) state. It reports the error before and
        after, and may take a name back; the whole of `record` can then be used to search.
    limits
        Lowest and highest value of inputs by name, for the test that is proposed; where it is not given, the test
        stays where the record has been.
    processes
        Fits that run at once.
    budget
        Seconds after which the search ends with what it has come to; None for as long as it takes.
    referred
        Whether a reference has shown that the model explains such records; it is then not asked for again.
    progress
        Called with a word for each stage and each fit.

    Returns
    -------
    Discovery
        The verdict, the extended model and all stages.

    Raises
    ------
    ModelError
        No site, no parameter of that name, or a limit that does not fit the inputs.
    """
    began = time.perf_counter()
    if not model.sites:
        raise ModelError(f"model '{model.name}' has no sites; pass its physical quantities through Scope.site")
    if limits:
        input_range(record.inputs, model.inputs, limits)  # a wrong limit is refused before the search
    names = model.expand_parameters(adapted or [p.name for p in model.parameters if p.role == "estimated"])
    state = State(model, names, report_record, limits, processes, progress, Screening(record, (), ()), referred)
    if budget is not None:
        now = time.monotonic()
        state = replace(state, ends=now + budget, search_ends=now + SEARCH_SHARE * budget)
    ended, verdict = _run(state)
    moved: Dataset | None = None
    for _ in range(MOST_AGAIN):
        finer = _finer(ended, verdict)
        later = with_later_inputs(ended, verdict) if moved is None else None
        if (finer is None and later is None) or time.monotonic() > state.search_ends:
            break
        asked = {"in shorter steps": finer, "with inputs moved by a row": later}
        progress(f"once more, {' and '.join(how for how, what in asked.items() if what is not None)}")
        moved = moved if later is None else later
        own, read = ended.model if finer is None else finer, record if moved is None else moved
        ended, verdict = _run(_in_steps_of(replace(state, screening=Screening(read, (), ())), own))
    finer = _finer(ended, verdict)
    if finer is not None:
        verdict = _taken_back(verdict, finer)
    verdict = _unless_cut_short(verdict)
    return ended.ended(replace(verdict, seconds=time.perf_counter() - began))


def _run(state: State) -> tuple[State, Verdict]:
    """All stages: what was worked out, and the verdict.

    The first ones once more in shorter steps where the best single effect asks for these: what is found in the end then
    asks for them, too, and all stages would be for nothing.
    """
    given, again, ahead = state, True, list(STAGES)
    while ahead:
        outcome = ahead.pop(0)(state)
        if isinstance(outcome, Verdict):
            return state, outcome
        state = outcome
        if again and state.first is not None:
            again, finer = False, _finer_for_one(state)
            if finer is not None and time.monotonic() < state.search_ends:
                state.progress("once more, in shorter steps")
                state, ahead = _in_steps_of(given, finer), list(STAGES)
    raise AssertionError("the last stage gives a verdict")


def _in_steps_of(state: State, model: Model) -> State:
    """A state before the first stage, with the steps of a model, which stay, and a note on these."""
    record = state.screening.record
    notes = dict.fromkeys((*record.notes, *steps_words(state.model, model)))
    noted = Screening(replace(record, notes=tuple(notes)), (), ())
    return replace(state, model=model, screening=noted, steps_stay=True)


def _finer_for_one(state: State) -> Model | None:
    """The model with steps as short as the best single effect asks for; None where it has them."""
    best = next(iter(state.first.round.alternatives), None) if state.first is not None else None
    return None if best is None else _finer_along(state, best.fit)


def _finer(state: State, verdict: Verdict) -> Model | None:
    """The model with steps as short as what is told asks for; None where it has them, and where nothing is told."""
    if verdict.word not in TELLING or state.after is None:
        return None
    return _finer_along(state, state.after)


def _finer_along(state: State, fit: Fit) -> Model | None:
    """The model with steps as short as a fit with effects asks for; None where it has them.

    The edges of an event in time fall between steps, whose length moves them a little: no stiffness.
    """
    if any(e.driver == "time" for e in fit.model.effects):
        return None
    finer = steps_for(state.known_problem, state.model, fit)
    return None if finer is state.model else finer


def _taken_back(verdict: Verdict, finer: Model) -> Verdict:
    """The verdict without its name: the integration errs along what is told."""
    why = f"the steps of the model are too long for what was found. Set max_step_s={finer.max_step_s:.3g}"
    return _without_its_name(verdict, why)


def _unless_cut_short(verdict: Verdict) -> Verdict:
    """The verdict, its name taken back where the time ended before further effects were tried, and much is left."""
    wrong = [spaced(c.output) for c in verdict.error if c.after > STILL_WRONG * c.noise]
    if verdict.word != "named" or NOT_ALL_TRIED not in verdict.notes or not wrong:
        return verdict
    why = f"the time for the search ended, and with what was found by then {', '.join(wrong)} is still wrong"
    return _without_its_name(verdict, why)


def _without_its_name(verdict: Verdict, why: str) -> Verdict:
    """The verdict without its name, and why."""
    nearest = verdict.reason[:1].lower() + verdict.reason[1:]
    reason = f"Something is missing, and it is not told what: {why}. The nearest: {nearest}"
    return replace(verdict, word="abstain", reason=reason, effects=(), members=())


STAGES: tuple[Callable[[State], State | Verdict], ...] = (
    screen_record,
    check_sufficient,
    split_rows,
    check_sufficient,
    fit_model_as_it_is,
    check_explained,
    examine_residual,
    allow_for_background,
    fit_single_effects,
    search_one_by_one,
    search_at_once,
    look_for_courses,
    compare_with_common_nuisance,
    judge_alternatives,
    fit_without_report,
    heed_report,
    try_as_course,
    tell_part_alone,
    heed_one_course,
    tell_background,
    second_opinion,
    compare_with_what_has_no_site,
    with_constants_alike,
    none_at_noise,
    heed_large_drift,
    tell_least_shown,
    plan_test,
    conclude,
)
"""The procedure: each stage takes what is known and hands on more, or ends it with a verdict (the last always does)."""
