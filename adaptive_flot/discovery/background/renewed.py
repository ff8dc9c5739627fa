"""The background beside the best effect: with that in place, its numbers may be others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.background.evidence import LARGEST, Spread, cost
from adaptive_flot.discovery.background.fitting import fit_with_background, spread_along, without_background
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem


def renewed(problem: Problem, base: Fit, best: Fit, feeds: Sequence[str]) -> tuple[Problem, Fit] | None:
    """The problem with the background that is found beside an effect, and its base fit; None where that is no better.

    A background is found before the effects. What an effect does is then in its numbers: constants that are too far
    off, or a feed that wanders too much. With these it takes up the effect, and favours any other that looks like it.

    Parameters
    ----------
    problem, base
        The record with a background, and the fit without an effect.
    best
        The best fit with effects. With the new numbers it must be better by LEAST_EVIDENCE.
    feeds
        Sites at which a course is tried.
    """
    background = problem.background
    if background is None or problem.time_is_up:
        return None
    old = Spread(background.course, background.constants, 0.0)
    spread = spread_along(replace(problem, background=None), problem, best, feeds)
    if not spread.numbers or spread.share >= LARGEST or _alike(spread, old):
        return None
    beside = _fit(problem, spread, best)
    if beside is None or cost(problem, beside[1], spread.numbers) > cost(problem, best, old.numbers) - LEAST_EVIDENCE:
        return None
    return _fit(problem, spread, base)


def _fit(problem: Problem, spread: Spread, fit: Fit) -> tuple[Problem, Fit] | None:
    """The problem and the fit with another background than theirs."""
    bare, plain = without_background(problem, fit), replace(problem, background=None)
    return fit_with_background(plain, spread, bare, Responses(plain, bare))


def _alike(one: Spread, other: Spread) -> bool:
    """Whether two backgrounds have the same numbers: both are on one grid."""
    return one.constants == other.constants and one.course == other.course
