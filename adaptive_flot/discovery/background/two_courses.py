"""A second course beside that of the feed: its site, and the numbers of both, to first order.

What wanders need not be the feed. A course at any site that acts on the same output explains about as much alone, and
one course can not stand for two. So both are sought at once, each with a size and a correlation time of its own.

With the projected whitened residual e, and the responses B to the courses and the constants, each in standard
deviations of its prior::

    drop = e'B (I + B'B)^-1 B'e - log det(I + B'B)

is the drop of minus two log-likelihood. Rasmussen & Williams (2006), eq. (5.8), by the matrix inversion lemma. Its
largest value is sought by one number after the other on a grid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from adaptive_flot.discovery.background.evidence import CONSTANTS, Spread, drops, price
from adaptive_flot.discovery.background.linear import lines_of_course, uncertain_constants, uncertain_profiles
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.record.background import Course, root_of_covariance
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.rescaled import logarithms_of_factors

STDS = np.geomspace(0.004, 0.6, 11)
"""Standard deviations of a course that are tried, as a share of the value at the site."""
LONGEST, TIMES = 1 / 2, 7
"""Longest correlation time, as a share of the record: a change at a site may be as slow as the record is long."""
TURNS, SETTLED = 3, 0.5
"""Turns over all numbers, and the gain below which they are where they stay."""


_Numbers = tuple[tuple[tuple[float, float], ...], float]
"""Standard deviation and correlation time of each course, and the standard deviation of the constants."""


class TwoCourses:
    """Evidence for a course at a site beside that of a feed, along one run.

    Parameters
    ----------
    problem, scorer, responses
        The record without a background, and scores and responses along a run.
    """

    def __init__(self, problem: Problem, scorer: Scorer, responses: Responses) -> None:
        self._problem, self._scorer, self._responses = problem, scorer, responses
        time = problem.record.time
        self._knots = lines_of_course(problem, responses.sites[0], False)[0]
        shortest = 2 * (self._knots[1] - self._knots[0])
        self._times = [float(t) for t in np.geomspace(shortest, LONGEST * (time[-1] - time[0]), TIMES)]
        self._roots = {t: root_of_covariance(self._knots, t) for t in self._times}
        self._constants = scorer.projected(responses.of(uncertain_profiles(problem, responses)))
        # what is off is counted from the model as it came
        off = logarithms_of_factors(responses.fit.model, uncertain_constants(responses))
        self._residual = scorer.residual + self._constants @ off

    def promising(self, beside: Scorer, sites: Sequence[str], most: int) -> list[str]:
        """Sites at which a course explains most of what a background leaves, which `beside` has, best first."""
        found = []
        for site in sites:
            X = self._lines(beside, site)
            information, along = X.T @ X, X.T @ beside.residual
            best = max(float(np.max(drops(information, along, root))) for root in self._roots.values())
            if best > 0:
                found.append((best, site))
        return [site for _, site in sorted(found, reverse=True)[:most]]

    def best(self, first: Spread, site: str | None = None) -> Spread:
        """The background with the largest drop: course of the feed, constants, and a course at a site if one is given.

        The search begins at the middle of its grid, with the size of the constants of `first`, whose feed it is.
        """
        assert first.course is not None  # asked where a feed wanders
        sites = [first.course.site] if site is None else [site, first.course.site]
        responses = [*(self._lines(self._scorer, s) for s in sites), self._constants]
        information, along = _products(responses), [B.T @ self._residual for B in responses]
        numbers: _Numbers = (((float(STDS[4]), self._times[3]),) * len(sites), first.constants)
        best, before = -np.inf, -np.inf
        for _ in range(TURNS):
            for i in range(len(sites) + 1):
                tried = self._along(information, along, numbers, i)
                best, numbers = max([(best, numbers), *tried], key=lambda found: found[0])
            if best < before + SETTLED:
                break
            before = best
        courses = [self._course(s, *n) for s, n in zip(sites, numbers[0], strict=True)]
        spread = Spread(courses[-1], numbers[1], best, numbers[0][-1][0])
        return spread if site is None else replace(spread, told=courses[0])

    def _along(
        self, information: list[list[FloatArray]], along: list[FloatArray], numbers: _Numbers, i: int
    ) -> Iterator[tuple[float, _Numbers]]:
        """Drops, less prices, with the i-th course in every way that is tried, or with constants of each size.

        What is held is worked out once, and what is tried is seen beside it, as in `evidence`.
        """
        courses, constants = numbers
        roots = [*(std * self._roots[t] for std, t in courses), constants * np.eye(len(along[-1]))]
        held = [k for k in range(len(roots)) if k != i]
        inner = np.block([[roots[j].T @ information[j][k] @ roots[k] for k in held] for j in held])
        shared = np.vstack([roots[j].T @ information[j][i] for j in held])
        own = np.concatenate([roots[j].T @ along[j] for j in held])
        factor = np.linalg.cholesky(np.eye(len(own)) + inner)
        shared, own = (solve_triangular(factor, right, lower=True) for right in (shared, own))
        held_drop = float(own @ own - 2 * np.sum(np.log(np.diag(factor))))
        information_i, along_i = information[i][i] - shared.T @ shared, along[i] - shared.T @ own
        paid = 2 * len(courses) * price(self._problem)
        if i == len(courses):
            sizes = np.array(CONSTANTS)
            gains = drops(information_i, along_i, np.eye(len(along_i)), sizes)
            for size, gain in zip(CONSTANTS, gains, strict=True):
                yield held_drop + float(gain) - paid - (price(self._problem) if size else 0.0), (courses, size)
            return
        paid += price(self._problem) if constants else 0.0
        for time in self._times:
            gains = drops(information_i, along_i, self._roots[time], STDS)
            for std, gain in zip(STDS, gains, strict=True):
                tried = (*courses[:i], (float(std), time), *courses[i + 1 :])
                yield held_drop + float(gain) - paid, (tried, constants)

    def _lines(self, scorer: Scorer, site: str) -> FloatArray:
        """Projected responses (values, k) to a course at a site, as a share of its usual value."""
        profiles = lines_of_course(self._problem, site, self._responses.is_offset(site))[1]
        return self._usual(site) * scorer.projected(self._responses.of(profiles))

    def _course(self, site: str, std: float, time: float) -> Course:
        return Course(site, std * self._usual(site), time, self._responses.is_offset(site))

    def _usual(self, site: str) -> float:
        return self._responses.usual(site) if self._responses.is_offset(site) else 1.0


def _products(responses: list[FloatArray]) -> list[list[FloatArray]]:
    """B'B in blocks."""
    return [[left.T @ right for right in responses] for left in responses]
