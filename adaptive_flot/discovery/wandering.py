"""Whether a feed that nobody measures wanders: it then explains the residual better than any effect.

A free run has no place for it. So its course is bent into effects that are not there: a curve in time at any site that
acts on the same output.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.wander import Wander, knots_of_course, lines_between, root_of_covariance
from adaptive_flot.discovery.search.alternatives import fit_variant, shortlist
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox.model import FloatArray

LEAST_SPAN_S = 7200.0
"""In a shorter record what wanders over a quarter of an hour is no more than a trend, or an event."""
MOST_KNOTS, LEAST_ROWS = 96, 4
"""Knots of a course, and the least rows between them."""
LONGEST = 1 / 8
"""Longest correlation time, as a share of the record: what is slower is a trend."""
TIMES, SIZES = 6, 16
"""Correlation times and standard deviations that are tried."""
SMALLEST, LARGEST = 0.002, 0.3
"""Standard deviations that are tried, as a share of the value at the site."""
MOST_BEFORE, FITTED = 3, 2
"""Effects that are fitted one on top of the other before a course is looked for, and how many are tried for each."""
LEAST_BLOCK_ROWS = 60
"""Least rows of a split: more than noise remembers, and than a plant takes to settle."""
LEAST_EVIDENCE = 10.0
"""Drop of minus two log-likelihood, less the price of two constants, that a course must bring."""


@dataclass(frozen=True)
class Course:
    """How a disturbance wanders, by how much it drops minus two log-likelihood, less the price of its two constants."""

    site: str
    std: float
    time: float
    offset: bool
    evidence: float
    share: float = 0.0
    """`std` as a share of the usual value at the site."""


def unmeasured_feeds(problem: Problem, base: Fit, responses: Responses) -> list[str]:
    """Sites of feeds that may wander unseen; none in a short record."""
    time = problem.record.time
    if time[-1] - time[0] < LEAST_SPAN_S:
        return []
    feeds = (site.name for site in base.model.sites if site.role == "feed")
    return [name for name in feeds if not _measured(problem, responses, name)]


def wandering(problem: Problem, base: Fit, responses: Responses, scorer: Scorer | None = None) -> Course | None:
    """How a feed wanders, where that explains the residual better than any effect; else None.

    A course competes with the effects, by first order (see `_best`). Where one of these explains more, the best is
    fitted first, and the course is looked for in what that leaves; MOST_BEFORE at most, and one at least: an effect
    that is far from linear must not be taken for a course.

    Parameters
    ----------
    problem, base
        The record, and the fit of the model as it is.
    responses, scorer
        Responses along that fit, and scores along it where they are known already.
    """
    feeds = unmeasured_feeds(problem, base, responses)
    if not feeds:
        return None
    fit, scorer = base, scorer or scorer_of(problem, base, responses)[0]
    for before in range(MOST_BEFORE + 1):
        best = max((_best(problem, scorer, responses, name) for name in feeds), key=lambda c: c.evidence)
        # a free curve in time at any site that acts on the same output is what a course would be taken for: no rival
        rival = max((s.penalised for s in scorer.scores() if not _free_in_time(s)), default=0.0)
        explains = best.evidence > max(LEAST_EVIDENCE, rival)
        if best.evidence <= LEAST_EVIDENCE or (explains and before):
            break
        extended = _with_best_effect(problem, fit, scorer) if before < MOST_BEFORE else None
        if extended is None:
            break
        fit, responses = extended, Responses(problem, extended)
        scorer = scorer_of(problem, fit, responses)[0]
    # what fits best as far as the last of the sizes is something else
    return best if explains and best.share < LARGEST else None


def _measured(problem: Problem, responses: Responses, site: str) -> bool:
    """Whether the value at a site is an input of the record: it may be wrong, but it does not wander unseen."""
    value = responses.site_values[site]
    return any(np.allclose(value, u, rtol=1e-9, atol=0.0) for u in problem.record.inputs.T)


def needed(problem: Problem, fit: Fit) -> bool:
    """Whether a fit with a course is better than the same without, by more than the price of the course's constants."""
    plain = Fitter(replace(problem, wander=None)).fit(fit.model, fit.names, like=fit, rounds=2)
    return plain is None or plain.loss - fit.loss > _price(problem) + LEAST_EVIDENCE


def _price(problem: Problem) -> float:
    return 2 * float(np.log(max(problem.count(problem.rows("estimate")), 2)))


def _with_best_effect(problem: Problem, fit: Fit, scorer: Scorer) -> Fit | None:
    """The fit with the best of the few effects that score best on top; None where none brings evidence."""
    fitter = Fitter(problem)
    fits = [fit_variant(fitter, fit, score, MOST_STEPS) for score in shortlist(scorer, FITTED)]
    good = [again for again in fits if again is not None and again.bic < fit.bic - LEAST_EVIDENCE]
    return min(good, key=lambda again: again.bic, default=None)


def _free_in_time(score: Score) -> bool:
    return score.candidate.driver == "time" and score.variant.effect.family.is_curve


def rows_of_block(course: Course, dt: float) -> int:
    """Least rows of a split: short against the course, so that held-out rows say more of an effect than of the feed."""
    return max(LEAST_BLOCK_ROWS, round(course.time / dt / 2))


def course_words(wander: Wander, unit: str) -> str:
    """What wanders and how, in a sentence."""
    size = f"{wander.std:.3g} {unit}".rstrip() if wander.offset else f"{100 * wander.std:.2g} %"
    return (
        f"The {wander.site} wanders: standard deviation about {size}, correlation time about {wander.time:.0f} s. Its "
        "course was estimated beside every alternative, and is in the errors before and after. What acts as this feed "
        "does, and changes as slowly, would look the same."
    )


def with_course(problem: Problem, course: Course, responses: Responses) -> Wander:
    """The disturbance, with its responses along the fit of these `responses`."""
    knots, lines = _lines(problem, course.site, course.offset)
    root = course.std * root_of_covariance(knots, course.time)
    return Wander(course.site, course.std, course.time, course.offset, responses.of(lines) @ root)


def _lines(problem: Problem, site: str, offset: bool) -> tuple[FloatArray, list[TimeProfile]]:
    time = problem.record.time
    knots = knots_of_course(time, MOST_KNOTS, LEAST_ROWS)
    return knots, [TimeProfile(site, line, offset) for line in lines_between(time, knots).T]


def _best(problem: Problem, scorer: Scorer, responses: Responses, site: str) -> Course:
    """The course at a site with the largest marginal likelihood.

    With the projected whitened residual e and responses X to the lines between knots, L L' the covariance there::

        drop = e'X L (I + L'X'X L)^-1 L'X'e - log det(I + L'X'X L)

    Rasmussen & Williams (2006), eq. (5.8), by the matrix inversion lemma. Standard deviation and correlation time cost
    2 log(number of measurements).
    """
    offset = next(s for s in responses.fit.model.sites if s.name == site).mode == "offset"
    knots, lines = _lines(problem, site, offset)
    X = scorer.projected(responses.of(lines))
    information, along = X.T @ X, X.T @ scorer.residual
    size = responses.usual(site) if offset else 1.0
    price = _price(problem)
    tried = [
        Course(site, std * size, time, offset, drop - price, std)
        for time in _times(problem.record.time, knots)
        for std, drop in _drops(information * size**2, along * size, root_of_covariance(knots, time))
    ]
    return max(tried, key=lambda c: c.evidence)


def _times(time: FloatArray, knots: FloatArray) -> list[float]:
    shortest, longest = 2 * (knots[1] - knots[0]), LONGEST * (time[-1] - time[0])
    return [float(t) for t in np.geomspace(shortest, max(longest, shortest), TIMES)]


def _drops(information: FloatArray, along: FloatArray, root: FloatArray) -> Iterator[tuple[float, float]]:
    strength, turned = np.linalg.eigh(root.T @ information @ root)
    strength, explained = np.maximum(strength, 0.0), (turned.T @ (root.T @ along)) ** 2
    for std in np.geomspace(SMALLEST, LARGEST, SIZES):
        grown = 1 + std**2 * strength
        yield float(std), float(np.sum(std**2 * explained / grown) - np.sum(np.log(grown)))
