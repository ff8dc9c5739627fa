"""What wanders at a site, where no effect explains the record beside a feed that wanders.

A feed is taken to wander where that explains the record best. What wanders elsewhere may be in its course. So where
nothing else is told, a second course is tried at every site, and fitted with numbers of its own for both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import (
    LEAST_EVIDENCE,
    loglik_difference_sds,
    rows_per_effective_sample,
)
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.background.evidence import Spread, cost
from adaptive_flot.discovery.background.fitting import fit_with_background, without_background
from adaptive_flot.discovery.background.linear import LEAST_ROWS, MOST_KNOTS
from adaptive_flot.discovery.background.two_courses import TwoCourses
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter, at_its_constants
from adaptive_flot.discovery.record.background import Background, Course, knots_of_course
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, SearchResult
from adaptive_flot.discovery.search.alternatives import effect_bounds
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.rescaled import factors_of, rescaled
from adaptive_flot.parallel import parallel_map

MOST_SITES = 6
"""Sites at which a second course is fitted: those that explain most to first order."""
LEAST_SMALLER, LEAST_LIKELIER = 0.1, 30.0
"""Share by which the error on the confirm split must be smaller, or drop of minus two log-likelihood there for each
effective sample. On development records it was 14 for a course that is not there, 424 and 648 for two that are."""


def with_courses(
    problem: Problem, result: SearchResult, processes: int = 1, progress: Callable[[str], None] = lambda stage: None
) -> tuple[Problem, SearchResult]:
    """The problem and the search, with what wanders at a site as its alternatives; both unchanged where nothing does.

    A second course must be better than the feed alone, with numbers that were sought in the same way, and better than
    the feed with a constant at its site, which a slow course draws. By LEAST_EVIDENCE for each effective sample, and by
    what the choice of a site is worth: 2 log(number of sites). And rows that chose neither must confirm it: by their
    likelihood (LEAST_LIKELIER), or by LEAST_SMALLER of the error. A feed that is no Gaussian process with one
    correlation time leaves some per cent to any second course on the same output.

    Parameters
    ----------
    problem, result
        The record with a background in which a feed wanders, and what was found beside it.
    processes, progress
        As in `search`.
    """
    background = problem.background
    assert background is not None  # asked where a feed wanders
    run = _Run.beside(problem, result.base)
    first = Spread(background.course, background.constants, 0.0)
    courses = TwoCourses(run.plain, scorer_of(run.plain, run.bare, run.responses, run.there.noise)[0], run.responses)
    alone, others = courses.best(first), run.other_sites(first)
    least = LEAST_EVIDENCE + 2 * float(np.log(len(others)))
    sites = courses.promising(scorer_of(problem, run.there)[0], others, MOST_SITES)

    def fitted(k: int) -> _Made | None:
        spread = courses.best(first, sites[k])
        return run.fitted(spread) if spread.evidence > alone.evidence + least and not problem.time_is_up else None

    ended = count(1)
    made = parallel_map(
        fitted, range(len(sites)), processes, lambda: progress(f"fit {next(ended)} of {len(sites)} courses")
    )
    if problem.time_is_up or not any(made):
        return problem, result
    base_problem, base, numbers = _better_alone(problem, run, first, alone)
    found = []
    for each in made:
        if each is not None:
            own, fit = run.with_model(each)
            fit = _paid(problem, fit, each.spread.numbers - numbers)
            name = each.told.site, "time"
            found.append(Alternative((name,), (True,), fit, base.loss - fit.loss, fit.bic - base.bic, problem=own))
    found.sort(key=lambda a: a.fit.bic)
    best = found[0]
    rows_each = rows_per_effective_sample(problem, base, best.fit)
    checked = verify(base_problem, base, best.fit, best.problem)
    reference = min(base.bic, _bic_with_constant(base_problem, base, best.names[0][0]))
    little = checked.reduction < LEAST_SMALLER and checked.likelihood < LEAST_LIKELIER * rows_each
    if best.fit.bic > reference - least * rows_each or not checked.confirmed or little:
        return problem, result
    differences = loglik_difference_sds(problem, best.fit, [a.fit for a in found])
    alternatives = tuple(replace(a, loglik_difference_sd=d) for a, d in zip(found, differences, strict=True))
    return base_problem, replace(
        result, base=base, alternatives=alternatives, verification=checked, left=0.0, left_threshold=0.0,
        rows_per_effective_sample=rows_each,
    )  # fmt: skip


@dataclass(frozen=True)
class _Made:
    """A background with a told course and its fit, as they come from another process: the fit has no model then."""

    spread: Spread
    background: Background
    fit: Fit
    factors: Mapping[str, float]
    values: Mapping[str, float]

    @property
    def told(self) -> Course:
        """The course that is told."""
        assert self.spread.told is not None  # only such are made
        return self.spread.told


@dataclass(frozen=True)
class _Run:
    """The record without a background, the run along which responses are worked out, and the fit that has the feed."""

    plain: Problem
    there: Fit
    bare: Fit
    responses: Responses

    @staticmethod
    def beside(problem: Problem, base: Fit) -> _Run:
        """The run of the fit beside a background, with the constants that this has."""
        own, plain = at_its_constants(problem, base), replace(problem, background=None)
        there = Fitter(problem).fit(own.model, own.names, like=own, rounds=2) or base
        bare = without_background(problem, there)
        return _Run(plain, there, bare, Responses(plain, bare))

    def other_sites(self, first: Spread) -> list[str]:
        """Sites but that of the feed, and those at which the model has an effect in time already."""
        taken = {e.site for e in self.bare.model.effects if e.driver == "time"}
        feed = first.course.site if first.course else ""
        return [s for s in self.responses.sites if s not in taken and s != feed]

    def _extended(self, told: Course) -> Model:
        knots = knots_of_course(self.plain.record.time, MOST_KNOTS, LEAST_ROWS)
        return self.bare.model.with_effects([told.effect(knots)])

    def fitted(self, spread: Spread) -> _Made | None:
        """The fit beside a told course, with a model that has it; None where it can not be simulated."""
        assert spread.told is not None  # sought for a site
        extended = replace(self.bare, model=self._extended(spread.told))
        made = fit_with_background(self.plain, spread, extended, self.responses)
        if made is None:
            return None
        problem, fit = made[0], Fitter(made[0]).at_its_constants(made[1])
        names, background = spread.told.parameters_in(fit.model), problem.background
        assert background is not None  # a fit with a background has one
        values = dict(zip(names, map(float, spread.told.values_in(fit.model)), strict=True))
        return _Made(spread, background, fit, factors_of(fit.model), values)

    def with_model(self, made: _Made) -> tuple[Problem, Fit]:
        """The problem of a course that was made, and its fit with the model, made anew where it came without."""
        problem = replace(self.plain, background=made.background)
        model = rescaled(self._extended(made.told), made.factors).with_parameters(made.values)
        return problem, made.fit.with_model(lambda: model)


def _better_alone(problem: Problem, run: _Run, first: Spread, again: Spread) -> tuple[Problem, Fit, int]:
    """The feed alone, with the numbers that it has or those that are sought as for two courses, and how many."""
    made = fit_with_background(run.plain, again, run.bare, run.responses)
    if made is None or cost(problem, made[1], again.numbers) > cost(problem, run.there, first.numbers):
        return problem, run.there, first.numbers
    return *made, again.numbers


def _bic_with_constant(problem: Problem, base: Fit, site: str) -> float:
    """Criterion of the feed alone with a constant at a site beside it; infinite where that can not be simulated."""
    shift = Effect(site, "constant", "shift")
    if any(e.label == shift.label for e in base.model.effects):
        return float("inf")
    model, name = base.model.with_effects([shift]), shift.parameter("amplitude")
    bounds = effect_bounds(problem, model, shift)
    fit = Fitter(problem).fit(model, (*base.names, name), like=base, bounds=bounds, rounds=2)
    return fit.bic if fit is not None else float("inf")


def _paid(problem: Problem, fit: Fit, numbers: int) -> Fit:
    """The fit with the price of so many numbers more than the base fit has in its criterion."""
    return replace(fit, bic=cost(problem, fit, numbers))
