"""What wanders at a site, where no effect explains the record beside a feed that wanders.

A feed is taken to wander where that explains the record best. What wanders elsewhere may be in its course. So where
nothing else is told, a second course is tried at every site, and fitted with numbers of its own for both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from adaptive_flot.discovery.assessment.likelihood import (
    LEAST_EVIDENCE,
    loglik_difference_sds,
    rows_per_effective_sample,
)
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.background.evidence import Spread, price
from adaptive_flot.discovery.background.fitting import fit_with_background, without_background
from adaptive_flot.discovery.background.linear import LEAST_ROWS, MOST_KNOTS
from adaptive_flot.discovery.background.two_courses import TwoCourses
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter, at_its_constants
from adaptive_flot.discovery.record.background import knots_of_course
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, SearchResult
from adaptive_flot.discovery.search.rounds import scorer_of

MOST_SITES = 6
"""Sites at which a second course is fitted: those that explain most to first order."""


def with_courses(
    problem: Problem, result: SearchResult, progress: Callable[[str], None] = lambda stage: None
) -> tuple[Problem, SearchResult]:
    """The problem and the search, with what wanders at a site as its alternatives; both unchanged where nothing does.

    A second course must be better than the feed alone, with numbers that were sought in the same way, by
    LEAST_EVIDENCE for each effective sample and the price of its numbers; and rows that chose neither must confirm it.

    Parameters
    ----------
    problem, result
        The record with a background in which a feed wanders, and what was found beside it.
    progress
        Called with a word for each fit.
    """
    background = problem.background
    assert background is not None  # asked where a feed wanders
    plain, own = replace(problem, background=None), at_its_constants(problem, result.base)
    there = Fitter(problem).fit(own.model, own.names, like=own, rounds=2) or result.base
    bare = without_background(problem, there)
    responses = Responses(plain, bare)
    courses = TwoCourses(plain, scorer_of(plain, bare, responses, there.noise)[0], responses)
    first = Spread(background.course, background.constants, 0.0)
    alone = courses.best(first)
    taken = {e.site for e in bare.model.effects if e.driver == "time"} | {first.course.site if first.course else ""}
    sites = [s for s in responses.sites if s not in taken]
    promising = courses.promising(scorer_of(problem, there)[0], sites, MOST_SITES)
    beside = [
        spread for site in promising if (spread := courses.best(first, site)).evidence > alone.evidence + LEAST_EVIDENCE
    ]
    if not beside:
        return problem, result
    base_problem, base, numbers = _better_alone(problem, there, first, alone, bare, responses)
    found = []
    for spread in beside:
        if problem.time_is_up:
            return problem, result
        assert spread.told is not None
        site = spread.told.site
        progress(f"fit {site} by time")
        made = _fitted(plain, spread, bare, responses)
        if made is not None:
            fit = _paid(problem, made[1], made[2] - numbers)
            found.append(
                Alternative(((site, "time"),), (True,), fit, base.loss - fit.loss, fit.bic - base.bic, problem=made[0])
            )
    found.sort(key=lambda a: a.fit.bic)
    if not found:
        return problem, result
    best = found[0]
    rows_each = rows_per_effective_sample(problem, base, best.fit)
    checked = verify(base_problem, base, best.fit, best.problem)
    if best.delta_bic > -LEAST_EVIDENCE * rows_each or not checked.confirmed:
        return problem, result
    differences = loglik_difference_sds(problem, best.fit, [a.fit for a in found])
    alternatives = tuple(replace(a, loglik_difference_sd=d) for a, d in zip(found, differences, strict=True))
    return base_problem, replace(
        result, base=base, alternatives=alternatives, verification=checked, left=0.0, left_threshold=0.0,
        rows_per_effective_sample=rows_each,
    )  # fmt: skip


def _better_alone(
    problem: Problem, there: Fit, first: Spread, again: Spread, bare: Fit, responses: Responses
) -> tuple[Problem, Fit, int]:
    """The feed alone, with the numbers that it has or those that are sought as for two courses, and how many."""
    made = fit_with_background(replace(problem, background=None), again, bare, responses)
    if made is None or _cost(problem, made[1], again.numbers) > _cost(problem, there, first.numbers):
        return problem, there, first.numbers
    return *made, again.numbers


def _cost(problem: Problem, fit: Fit, numbers: int) -> float:
    return fit.bic + numbers * price(problem)


def _paid(problem: Problem, fit: Fit, numbers: int) -> Fit:
    """The fit with the price of so many numbers more than the base fit has in its criterion."""
    return replace(fit, bic=_cost(problem, fit, numbers))


def _fitted(plain: Problem, spread: Spread, bare: Fit, responses: Responses) -> tuple[Problem, Fit, int] | None:
    """A background with a told course, its fit with a model that has the course, and how many numbers it has."""
    assert spread.told is not None  # sought for a site
    knots = knots_of_course(plain.record.time, MOST_KNOTS, LEAST_ROWS)
    extended = replace(bare, model=bare.model.with_effects([spread.told.effect(knots)]))
    made = fit_with_background(plain, spread, extended, responses)
    if made is None:
        return None
    problem, fit = made
    return problem, Fitter(problem).at_its_constants(fit), spread.numbers
