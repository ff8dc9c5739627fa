"""Time profiles with more freedom, and curves with less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import worth_its_freedom
from adaptive_flot.discovery.candidates.catalogue import FINE_TIME_KNOTS
from adaptive_flot.discovery.candidates.knots import trimmed
from adaptive_flot.discovery.candidates.shapes.step_events import freer
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, best_of_each, is_curve, near
from adaptive_flot.discovery.search.halving.refits import Refit

FREED, MOST_FREED = 2, 8
"""Names whose time profile gets more freedom in the end; further ones where that was worth its price to the first."""


def freed(refit: Refit, best: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
    """Time profiles with more freedom where that pays; whom a rough profile is to tell apart must all have it."""
    freed = _freer(refit, best[:FREED], best, last)
    if freed:
        ended = {fitted.alternative.names for fitted in last}
        others = [fitted for fitted in best[FREED:MOST_FREED] if fitted.alternative.names in ended]
        freed += _freer(refit, others, best, last)
    return freed


def simpler(refit: Refit, best: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
    """Curves without the knots that they do not need, so that no profile loses for a freedom it did not use.

    Where another form is the best of a name so far, its curve is trimmed all the same.
    """
    jobs = best[:MOST_FREED]
    names = {fitted.alternative.names for fitted in jobs}
    every = [fitted for fitted in (*jobs, *last) if fitted.alternative.names in names and is_curve(fitted)]
    curves = best_of_each(every)
    return refit.run(_fewer(refit, [*(fitted for fitted in jobs if not is_curve(fitted)), *curves]))


def _fewer(refit: Refit, jobs: list[FittedJob]) -> list[Job]:
    count = refit.fitter.problem.count(refit.fitter.rows)
    return fewer_knots(near(jobs), float(np.log(max(count, 2))))


def _freer(refit: Refit, jobs: list[FittedJob], best: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
    names = {fitted.alternative.names for fitted in jobs}
    curves = best_of_each([fitted for fitted in last if fitted.alternative.names in names and is_curve(fitted)])
    both = [*(fitted for fitted in jobs if not is_curve(fitted)), *curves]
    free = refit.run([job for fitted in both for job in more_freedom(fitted, refit.low, refit.high)])
    fewer = _fewer(refit, free)
    free += refit.run([*fewer, *from_scratch(fewer)])
    bound = {fitted.alternative.names: fitted.alternative.fit for fitted in best}
    problem = refit.fitter.problem
    return [r for r in free if worth_its_freedom(problem, bound[r.alternative.names], r.alternative.fit)]


def more_freedom(fitted: FittedJob, low: float, high: float) -> list[Job]:
    """The same time profile with more freedom, where a curve or a smooth event was the best of its name."""
    effect = fitted.alternative.effects[-1]
    freed = freer(effect, low, high) if effect.driver == "time" else None
    if freed is None:
        return []
    variant, start = freed
    return [
        Job(
            fitted.linearisation,
            replace(fitted.score, variant=variant, start=start),
            fitted.alternative.fit,
            drawn=True,
        )
    ]


def fewer_knots(runs: list[FittedJob], price: float) -> list[Job]:
    """For each name the curve that should come out best without the knots that it does not need, from its fit."""
    best: dict[tuple[tuple[str, str], ...], tuple[float, Job]] = {}
    for fitted in runs:
        a = fitted.alternative
        less = trimmed(a.fit, a.effects[-1], price)
        if less is None:
            continue
        promised = a.fit.bic - less.gain
        if a.names not in best or promised < best[a.names][0]:
            score = replace(fitted.score, variant=less.variant, start=less.start)
            best[a.names] = promised, Job(fitted.linearisation, score, a.fit, drawn=True)
    return [job for _, job in best.values()]


def from_scratch(jobs: list[Job]) -> list[Job]:
    """The same curves from nothing: a rough one may have led the initial state astray, and each finer one with it."""
    short = [job for job in jobs if len(job.score.start) <= FINE_TIME_KNOTS]
    return [replace(j, score=replace(j.score, start=dict.fromkeys(j.score.start, 0.0)), warm=None) for j in short]
