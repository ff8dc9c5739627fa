"""The stages of `discover`, from the data to the proposed test. Each takes what is known and hands on more."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from adaptive_flot.discovery.assessment.detect import detect
from adaptive_flot.discovery.assessment.explained import nothing_explained
from adaptive_flot.discovery.background.fitting import (
    fit_with_background,
    needed,
    with_course_told,
    without_constants,
)
from adaptive_flot.discovery.background.linear import feeds_unseen
from adaptive_flot.discovery.background.renewed import renewed
from adaptive_flot.discovery.background.spread import BLOCK_ROWS, may_have_background, spread_of
from adaptive_flot.discovery.background.told_course import with_courses
from adaptive_flot.discovery.background.wording import background_words, subject
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.base_fit import prepare, split_finer, split_record
from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import at_every_row
from adaptive_flot.discovery.fitting.onsets import with_onset_sought
from adaptive_flot.discovery.fitting.running_off import where_it_runs_off
from adaptive_flot.discovery.fitting.step_length import steps_for, steps_words
from adaptive_flot.discovery.fitting.unseen_times import with_unseen_changes, with_unseen_ends
from adaptive_flot.discovery.record.even_steps import steps_evenly
from adaptive_flot.discovery.record.problem import CYCLE, WITHOUT_REPORT, Problem
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.discovery.record.screening import screen, where_noise_changes
from adaptive_flot.discovery.results import State, Verdict
from adaptive_flot.discovery.search.common_nuisance import adjust_for_common_nuisance
from adaptive_flot.discovery.search.joint_search import search_jointly, wants_joint
from adaptive_flot.discovery.search.mirrored import with_mirrored_lags
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.search.search import first_round, search
from adaptive_flot.discovery.test_design.experiment import TEST_ROWS, leading, plan_experiment
from adaptive_flot.discovery.test_design.movable import held_inputs, held_words
from adaptive_flot.discovery.verdict.certain_part import with_certain_part
from adaptive_flot.discovery.verdict.conclude import insufficient
from adaptive_flot.discovery.verdict.idle_effects import without_idle_effects
from adaptive_flot.discovery.verdict.judge import (
    but_for_what_has_no_reason,
    constants_told,
    first_that_stands,
    held_up,
    judge,
    least_separation,
    undecided_rivals,
)
from adaptive_flot.greybox.effects import LATE
from adaptive_flot.greybox.rescaled import factors_of, rescaled
from adaptive_flot.greybox.steady.assumed_start import wrong_start
from adaptive_flot.greybox.steady.likely_unit import off_by_a_unit

FINAL_SHARE, TEST_SHARE = 0.6, 0.5
"""How long the last fits, and the proposed test, take: about so many times what the fit of the model as it is took."""

NOT_ALL_TRIED = "the time for the search ended: further effects and freer forms were not all tried"
NONE_FITTED = "no parameter has the role 'estimated': all keep the values of the model"


def screen_record(state: State) -> State:
    """Leave out what in the record can not be used."""
    state.progress("check the data")
    return replace(state, screening=screen(state.screening.record, state.model))


def check_sufficient(state: State) -> State | Verdict:
    """Give up where what is left of the record says too little."""
    return insufficient(state.screening) if state.screening.reasons else state


def split_rows(state: State) -> State:
    """Split the rows: to estimate, to confirm and, where no other record reports, to report."""
    state.progress("fit the model as it is")
    cycle = CYCLE if state.report_record is None else WITHOUT_REPORT
    problem, screening = split_record(state.screening, state.model, state.adapted, cycle)
    return replace(state, problem=replace(problem, deadline=state.search_ends), screening=screening)


def fit_model_as_it_is(state: State) -> State | Verdict:
    """Fit the model without any effect: the base of every comparison."""
    began = time.monotonic()
    model = steps_for(state.known_problem, state.model, longer=not state.steps_stay)
    prepared = prepare(state.known_problem, model)
    again = model if prepared is None else steps_for(prepared[0], model, prepared[1])
    if again is not model:
        model, prepared = again, prepare(state.known_problem, again)
    if prepared is None:
        ran_off = where_it_runs_off(state.known_problem, model)
        reason = f"the model '{model.name}' can not simulate the record{f': {ran_off}' if ran_off else ''}; "
        reason += "check the units of the columns, and the values that the model starts from"
        return insufficient(replace(state.screening, reasons=(reason,)))
    problem, base = prepared
    responses = Responses(problem, base)
    evenly = frozenset(j for j, values in enumerate(problem.measured.T) if steps_evenly(values))
    problem = replace(problem, site_sizes=responses.sizes, absorbed=responses.absorbed_constants(), evenly_moved=evenly)
    noise = noise_by_differences(problem.measured)
    start = base.initial_state, parameters_of(base)
    said = off_by_a_unit(state.model, problem.record.inputs, problem.record.outputs)
    said += steps_words(state.model, model)
    said += wrong_start(base.model, problem.record, *start, problem.columns, np.maximum(noise, problem.floor))
    if not state.adapted:
        said += (NONE_FITTED,)
    said += at_the_end_of_their_range(base)
    measured = [state.model.outputs[c].name for c in problem.columns]
    doubtful = where_noise_changes(problem.noise_changes, measured, problem.record.time)
    said += tuple(f"{each}: rows with more noise count less" for each in doubtful)
    screening = state.screening
    screening = replace(screening, notes=screening.notes + said, suspects=screening.suspects + doubtful)
    took = time.monotonic() - began
    problem = replace(problem, deadline=min(problem.deadline, state.ends - FINAL_SHARE * took))
    state = replace(state, model=model, screening=screening, problem=problem, base_seconds=took)
    return replace(state, base=base, responses=responses)


def at_the_end_of_their_range(base: Fit) -> tuple[str, ...]:
    """Notes on constants that the fit of the model as it is has moved to where they end.

    At a lower end of zero all that they multiply is zero, and no factor on it changes anything: a leak that opened
    later could not be found at a leak of zero.
    """
    said = []
    for name, value in zip(base.names, map(float, base.values), strict=True):
        q = base.model.parameters[base.model.index("parameters", name)]
        end = q.end_at(value)
        if not end:
            continue
        zero = end == "lower" and q.lower == 0
        advice = "give it a lower end above zero" if zero else "widen the range if it may lie beyond"
        why = ", so that nothing that it multiplies can change" if value == 0 else ""
        said.append(f"{q.label} is fitted at the {end} end of its range, {value:g}{why}: {advice}")
    return tuple(said)


def check_explained(state: State) -> State | Verdict:
    """Give up where the inputs explain nothing: no dependence could be told from a disturbance.

    Not where a reference has shown that they do: what has changed may be what made them explain so much.
    """
    reason = "" if state.referred else nothing_explained(*state.fitted)
    return insufficient(replace(state.screening, reasons=(reason,))) if reason else state


def examine_residual(state: State) -> State:
    """Say whether the residual is more than noise. It is reported, and decides nothing."""
    state.progress("test the residual")
    return replace(state, detection=detect(*state.fitted))


def allow_for_background(state: State) -> State:
    """Let a feed that nobody measures wander and constants be off, where that explains more than any effect."""
    problem, base = state.fitted
    if state.responses is None or problem.time_is_up or not may_have_background(problem, state.responses):
        return state
    state.progress("look for a background")
    responses = state.responses
    scored = scorer_of(problem, base, responses)
    spread = spread_of(problem, base, responses, scored[0])
    if spread is None:
        return replace(state, scored=scored)  # the search begins with the same
    cycle = CYCLE if state.report_record is None else WITHOUT_REPORT
    if spread.course is not None:  # constants are the same in every split
        problem = split_finer(problem, cycle, BLOCK_ROWS)
    fitted = fit_with_background(problem, spread, base, responses)
    if fitted is None:
        return state
    problem, base = fitted
    return replace(state, problem=problem, base=base, responses=Responses(problem, base))


def fit_single_effects(state: State) -> State:
    """Fit single effects; where the background has other numbers beside the best of them, once more beside that."""
    problem, base = state.fitted
    state.progress("score")
    scored = state.scored or scorer_of(problem, base, state.responses)
    run = partial(first_round, processes=state.processes, progress=state.progress)
    first = run(problem, base, rescaled(state.model, factors_of(base.model)), scored=scored)
    responses, state = state.responses, replace(state, responses=None, scored=None)
    if problem.background is not None and responses is not None and first.round.alternatives:
        state.progress("look for the background beside the best effect")
        again = renewed(problem, base, first.round.alternatives[0].fit, feeds_unseen(problem, responses))
        if again is not None:
            problem, base = again
            first = run(problem, base, rescaled(state.model, factors_of(base.model)))
    return replace(state, problem=problem, base=base, first=first)


def search_one_by_one(state: State) -> State:
    """Add one effect after the other, as long as each brings evidence and substance; confirm the best."""
    problem, base = state.fitted
    nominal = rescaled(state.model, factors_of(base.model))
    found = search(problem, base, nominal, first=state.first, processes=state.processes, progress=state.progress)
    alone = [a for a in state.first.round.alternatives if len(a.names) == 1] if state.first else []
    late = {(site, driver): -a.delta_bic for a in alone for site, driver in a.names if driver in LATE}
    return replace(state, search=found, first=None, late=late)


def search_at_once(state: State) -> State:
    """Search several effects at once where fits are cheap and the error still outweighs the noise by far."""
    problem, result = state.searched
    if not wants_joint(problem, result):
        return state
    problem, result = search_jointly(problem, result, processes=state.processes, progress=state.progress)
    return replace(state, problem=problem, base=result.base, search=result)


def look_for_courses(state: State) -> State:
    """Ask what else may wander, where nothing is told beside a feed that does."""
    problem, result = state.searched
    if problem.time_is_up or problem.background is None or problem.background.course is None:
        return state
    judgement = judge(first_that_stands(problem, result))
    if judgement.word != "none" or judgement.best is not None:
        return state
    state.progress("look for what else wanders")
    problem, result = with_courses(problem, result, state.processes, state.progress)
    return replace(state, problem=problem, base=result.base, search=result)


def tell_background(state: State) -> State:
    """Say that a feed wanders, and how far constants are off, where the best alternative needs it."""
    problem, result = state.searched
    best = result.alternatives[0] if result.alternatives else None
    fit, problem = (result.base, problem) if best is None else (best.fit, best.problem or problem)
    background = problem.background
    if background is None:
        return state
    if needed(problem, fit):
        units = {site.name: site.unit or "" for site in fit.model.sites}
        return replace(state, background=background_words(background, units))
    said = f"{subject(background)} estimated beside every alternative; beside the best one it is not needed"
    return replace(state, screening=replace(state.screening, notes=(*state.screening.notes, said)))


def compare_with_common_nuisance(state: State) -> State:
    """Compare the leading alternatives anew, with what all of them lack added to each."""
    problem, result = state.searched
    rivals = undecided_rivals(result) if problem.whiten and not problem.time_is_up else ()
    if not rivals or rivals[0].problem is not None:
        return state
    state.progress("compare with a common nuisance")
    return replace(state, search=adjust_for_common_nuisance(problem, result, rivals, state.processes))


def judge_alternatives(state: State) -> State:
    """Turn the ranking into one of six words; what is named must itself stand on the confirm split."""
    problem, result = state.searched
    result = with_mirrored_lags(problem, result)
    result = first_that_stands(problem, result)
    result, judgement = held_up(problem, result, judge(result))
    result, judgement = without_idle_effects(problem, result, judgement)
    if problem.background is not None:
        judgement = but_for_what_has_no_reason(result, judgement)
    judgement = with_certain_part(problem, result, judgement)
    said = state.screening.notes
    if problem.time_is_up:
        said = (*said, NOT_ALL_TRIED)
    if not result.rounds[0].compared:
        judgement = replace(judgement, word="abstain", members=())
    screening = replace(state.screening, notes=said)
    return replace(state, screening=screening, search=result, judgement=judgement)


def fit_without_report(state: State) -> State:
    """Fit the plain model and the best alternative to all rows but the report split, run at every row.

    A constant that is told is no part of the background beside it: its whole size is that of the effect.
    """
    state.progress("fit once more, without the report split")
    problem, base = state.fitted
    problem = replace(problem, deadline=state.ends)
    splits = ("estimate", "confirm")

    def final(beside: Problem, fit: Fit) -> Fit:
        fitter, every = Fitter(beside, splits), Fitter(replace(beside, nodes=None), splits)
        again = with_onset_sought(fitter, fitter.fit(fit.model, fit.names, like=fit, rounds=2) or fit)
        again = with_unseen_ends(fitter, again)
        again = at_every_row(fitter, again, {})
        if beside.background is not None and beside.background.told is not None:
            again = fitter.at_its_constants(again)
        return with_course_told(beside, every.with_intervals(again))

    best, before = state.judged.best, final(problem, base)
    if best is None:
        return replace(state, before=before, after=before)
    own = replace(best.problem or problem, deadline=state.ends)
    beside, fit = without_constants(own, best.fit, constants_told(state.judged))
    after, times = with_unseen_changes(Fitter(beside, splits), final(beside, fit))
    said = tuple(f"the change at {t:.4g} s lies within the report split, and its time was read from it" for t in times)
    screening = replace(state.screening, notes=(*state.screening.notes, *said))
    return replace(state, before=before, after=after, problem_after=beside, screening=screening)


def plan_test(state: State) -> State:
    """Choose the input moves that would tell the leading alternatives apart, where there are several."""
    judgement, (problem, result) = state.judged, state.searched
    if (
        judgement.best is None
        or judgement.word == "none"
        or judgement.best.problem is not None  # moves of the inputs tell little of what wanders by itself
        or time.monotonic() + TEST_SHARE * state.base_seconds > state.ends
    ):
        return state
    state.progress("plan a test")
    compared = [
        replace(a, fit=Fitter(problem).with_intervals(a.fit))
        for a in leading(judgement.best, result.alternatives, judgement.margin)
    ]
    if len(compared) < 2:
        return state
    held = held_inputs(state.model, problem.record, tuple(state.limits or ()))
    needed = least_separation(result, problem, TEST_ROWS)
    experiment = plan_experiment(problem, compared, needed, state.limits, state.processes, held)
    if experiment is None:
        said = (
            "no test of the inputs is proposed: none may be moved, none moves in this record, or each would bring an "
        )
        said += "output far beyond where it has been"
        said += f"; left alone: {held_words(held)}" if held else ""
        state = replace(state, screening=replace(state.screening, notes=(*state.screening.notes, said)))
    return replace(state, experiment=experiment)
