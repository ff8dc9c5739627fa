"""What is still told where the whole is not: a course in the place of a curve in time, or one effect of a set.

Both are judged like any other name: they are fitted once more without the report split, and the report rows have their
veto. They come where nothing else is told, so they can not replace a verdict.
"""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.background.told_course import with_courses
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.stages import fit_without_report, judge_alternatives
from adaptive_flot.discovery.verdict.certain_part import part_alone
from adaptive_flot.discovery.verdict.heed_report import heed_report
from adaptive_flot.discovery.verdict.words.wording import beside_a_part


def try_as_course(state: State) -> State:
    """Tell as a course what held-out rows contradict as a curve in time.

    A quantity that wanders has no curve that could be carried on: between and beyond the rows that were fitted, a
    spline goes astray. A course has a size and a correlation time, and goes back to its mean there. It is sought at
    every site, as beside any feed that wanders, so another site may come out of it.
    """
    problem, result = state.searched
    best = state.judged.best
    if not state.contradiction or best is None or best.problem is not None or problem.time_is_up:
        return state
    in_time = len(best.names) == 1 and best.names[0][1] == "time" and best.effects[0].family.is_curve
    if not in_time or problem.background is None or problem.background.course is None:
        return state
    state.progress("look for what wanders")
    beside, found = with_courses(problem, result, state.processes, state.progress)
    if found is result:
        return state
    return _heard(judge_alternatives(replace(state, problem=beside, base=found.base, search=found)), state)


def tell_part_alone(state: State) -> State:
    """Name one effect of a set that is not told, where it is certain and held-out rows support it alone."""
    problem, result = state.searched
    if problem.time_is_up:
        return state
    part = part_alone(problem, result, state.judged)
    if part is None:
        return state
    state.progress("a part of it alone")
    judgement, checked = part
    told = _heard(replace(state, judgement=judgement, search=replace(result, verification=checked)), state)
    if told is state:
        return state
    beside = beside_a_part(replace(state.judged, part=judgement.best.names if judgement.best else ()))
    return replace(told, certain=beside.rstrip())


def _heard(anew: State, state: State) -> State:
    """The state with the last fits and the word of the report rows; the one before where nothing is told then."""
    if anew.judged.word not in WITH_A_NAME:
        return state
    heard = heed_report(fit_without_report(anew))
    return heard if heard.judged.word in WITH_A_NAME else state
