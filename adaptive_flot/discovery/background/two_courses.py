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
from itertools import product

import numpy as np
from scipy.linalg import block_diag, solve_triangular

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
            best = max(drop for root in self._roots.values() for _, drop in drops(information, along, root))
            if best > 0:
                found.append((best, site))
        return [site for _, site in sorted(found, reverse=True)[:most]]

    def best(self, first: Spread, site: str | None = None) -> Spread:
        """The background with the largest drop: course of the feed, constants, and a course at a site if one is given.

        The search begins at the middle of its grid, with the size of the constants of `first`, whose feed it is.
        """
        assert first.course is not None  # asked where a feed wanders
        sites = [first.course.site] if site is None else [site, first.course.site]
        B = np.hstack([*(self._lines(self._scorer, s) for s in sites), self._constants])
        information, along = B.T @ B, B.T @ self._residual

        def drop(numbers: _Numbers) -> float:
            root = block_diag(
                *(std * self._roots[t] for std, t in numbers[0]), numbers[1] * np.eye(self._constants.shape[1])
            )
            paid = price(self._problem) * (2 * len(sites) + (numbers[1] > 0))
            return _drop(root.T @ information @ root, root.T @ along) - paid

        start: _Numbers = (((float(STDS[4]), self._times[3]),) * len(sites), first.constants)
        best = drop(start), start
        for _ in range(TURNS):
            before = best[0]
            for i in range(len(sites) + 1):
                tried = ((drop(numbers), numbers) for numbers in self._others(best[1], i))
                best = max([best, *tried], key=lambda found: found[0])
            if best[0] < before + SETTLED:
                break
        evidence, (numbers, constants) = best
        courses = [self._course(s, *n) for s, n in zip(sites, numbers, strict=True)]
        spread = Spread(courses[-1], constants, evidence, numbers[-1][0])
        return spread if site is None else replace(spread, told=courses[0])

    def _others(self, numbers: _Numbers, i: int) -> Iterator[_Numbers]:
        """The numbers with the i-th course in every way that is tried, or with constants of each size."""
        courses, constants = numbers
        if i == len(courses):
            yield from ((courses, size) for size in CONSTANTS)
            return
        for own in product(map(float, STDS), self._times):
            yield (*courses[:i], own, *courses[i + 1 :]), constants

    def _lines(self, scorer: Scorer, site: str) -> FloatArray:
        """Projected responses (values, k) to a course at a site, as a share of its usual value."""
        profiles = lines_of_course(self._problem, site, self._responses.is_offset(site))[1]
        return self._usual(site) * scorer.projected(self._responses.of(profiles))

    def _course(self, site: str, std: float, time: float) -> Course:
        return Course(site, std * self._usual(site), time, self._responses.is_offset(site))

    def _usual(self, site: str) -> float:
        return self._responses.usual(site) if self._responses.is_offset(site) else 1.0


def _drop(information: FloatArray, along: FloatArray) -> float:
    """The drop of the equation above, from B'B (k, k) and B'e (k,) in standard deviations of the prior."""
    root = np.linalg.cholesky(np.eye(len(along)) + information)
    own = solve_triangular(root, along, lower=True)
    return float(own @ own - 2 * np.sum(np.log(np.diag(root))))
