"""Marginal likelihood of the numbers of a background, to first order.

With the projected whitened residual e, the responses C to the constants and X to the lines between the knots of a
course, L L' the correlation at the knots, and D the prior variances of the constants::

    V = I + C D C'
    drop = e'(I - V^-1)e - log det V
         + s^2 e'V^-1 X L (I + s^2 L'X'V^-1 X L)^-1 L'X'V^-1 e - log det(I + s^2 L'X'V^-1 X L)

is the drop of minus two log-likelihood. Rasmussen & Williams (2006), eq. (5.8), twice by the matrix inversion lemma.
Each number costs log(number of measurements): the standard deviation of the constants, that of the course s, and its
correlation time, on which L depends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.background.linear import lines_of_course, uncertain_constants, uncertain_profiles
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.background import Course, root_of_covariance
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.rescaled import logarithms_of_factors

LONGEST = 1 / 8
"""Longest correlation time, as a share of the record: what is slower is a trend."""
TIMES, SIZES = 6, 16
"""Correlation times and standard deviations that are tried."""
SMALLEST, LARGEST = 0.002, 0.3
"""Standard deviations of a course that are tried, as a share of the value at the site."""
STDS: FloatArray = np.geomspace(SMALLEST, LARGEST, SIZES)
"""All of these."""
CONSTANTS = (0.0, 0.01, 0.02, 0.04, 0.07, 0.12, 0.2)
"""Standard deviations of the logarithm of the constants that are tried."""
STANDS_OUT = 1.0
"""Standard deviation of the logarithm of a constant that stands out from the others: a factor of e."""
MOST_STAND_OUT = 3
LEAST_KNOWN = 0.04
"""Beside constants that stand out, the others are known to so much at best: no constant of a plant is exact."""


@dataclass(frozen=True)
class Spread:
    """The numbers of a background, and by how much it drops minus two log-likelihood, less the price of these.

    Attributes
    ----------
    course, constants
        As in `Background`.
    evidence
        The drop.
    share
        Standard deviation of the course as a share of the usual value at its site.
    told
        A course that is told as an effect.
    """

    course: Course | None
    constants: float
    evidence: float
    share: float = 0.0
    told: Course | None = None

    @property
    def numbers(self) -> int:
        """How many numbers of it were chosen: size and correlation time of a course, size of the constants."""
        return 2 * (self.course is not None) + 2 * (self.told is not None) + (self.constants > 0)


def price(problem: Problem) -> float:
    """Price of a number of a background: log(number of measurements)."""
    return float(np.log(max(problem.count(problem.rows("estimate")), 2)))


def cost(problem: Problem, fit: Fit, numbers: int) -> float:
    """Criterion of a fit with the price of so many numbers of its background."""
    return fit.bic + numbers * price(problem)


@dataclass(frozen=True)
class _Feed:
    """A course that is tried: its site, knots, and products of its responses X with each other, with e and with C."""

    site: str
    offset: bool
    usual: float
    knots: FloatArray
    information: FloatArray
    along: FloatArray
    shared: FloatArray
    _known: dict[float, tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)

    def axes(self, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Strengths along the axes of a course with this correlation time, and L'X'e and C'XL in these axes.

        They are worked out once for all constants that are tried beside it: this is what takes the time.
        """
        if time not in self._known:
            root = root_of_covariance(self.knots, time)
            strength, turned = _axes(self.information, root)
            turned = root @ turned
            self._known[time] = strength, turned.T @ self.along, self.shared @ turned
        return self._known[time]


class Evidence:
    """Marginal likelihood of backgrounds along one run."""

    def __init__(self, problem: Problem, scorer: Scorer, responses: Responses, feeds: Sequence[str]) -> None:
        self._price, self._time = price(problem), problem.record.time
        C = scorer.projected(responses.of(uncertain_profiles(problem, responses)))
        left, strength, turned = np.linalg.svd(C, full_matrices=False)
        self._turned = strength[:, None] * turned  # C = left @ _turned
        e = scorer.residual + C @ logarithms_of_factors(
            responses.fit.model, uncertain_constants(responses)
        )  # what is off is counted from the model as it came
        self._own = left.T @ e
        self.count = len(self._own)
        self._feeds = []
        for site in feeds:
            offset = responses.is_offset(site)
            knots, lines = lines_of_course(problem, site, offset)
            usual = responses.usual(site) if offset else 1.0
            X = usual * scorer.projected(responses.of(lines))
            self._feeds.append(_Feed(site, offset, usual, knots, X.T @ X, X.T @ e, left.T @ X))

    @cached_property
    def best(self) -> Spread:
        """The background with the largest evidence: a course at one of the feeds, constants, or both."""
        sizes = CONSTANTS if self.count else CONSTANTS[:1]
        tried = [s for size in sizes for s in self._with_constants(size, np.full(self.count, size**2))]
        return max(tried, key=lambda s: s.evidence)

    def but_for_what_stands_out(self, best: Spread) -> Spread:
        """The same background beside constants that stand out: one that is far off must not widen all the others.

        One constant after the other gets a wide prior (STANDS_OUT), as long as that brings evidence (LEAST_EVIDENCE).
        """
        if not best.constants:
            return best
        wide: tuple[int, ...] = ()
        for _ in range(min(MOST_STAND_OUT, self.count)):
            tried = []
            for k in set(range(self.count)) - set(wide):
                for size in (c for c in CONSTANTS if min(LEAST_KNOWN, best.constants) <= c <= best.constants):
                    variances = np.full(self.count, size**2)
                    variances[[*wide, k]] = STANDS_OUT**2
                    tried += [((*wide, k), s) for s in self._with_constants(size, variances, best.course)]
            names, again = max(tried, key=lambda t: t[1].evidence)
            if again.evidence < best.evidence + LEAST_EVIDENCE:
                break
            wide, best = names, again
        return best

    def _with_constants(self, size: float, variances: FloatArray, course: Course | None = None) -> Iterator[Spread]:
        """Backgrounds with these prior variances of the constants: without a course and with each, or with one."""
        grown, axes = np.linalg.eigh((self._turned * variances) @ self._turned.T)
        grown = np.maximum(grown, 0.0)
        less, own = grown / (1 + grown), axes.T @ self._own
        drop = float(less @ own**2 - np.sum(np.log1p(grown))) - (self._price if size else 0.0)
        if course is None:
            yield Spread(None, size, drop)
        for feed in self._feeds:
            if course is not None and course.site != feed.site:
                continue
            for time in self._times(feed.knots) if course is None else [course.time]:
                strength, along, shared = feed.axes(time)
                beside = np.sqrt(less)[:, None] * (axes.T @ shared)
                gains = gains_beside(strength, along - beside.T @ (np.sqrt(less) * own), beside)
                for std, gained in zip(STDS, gains, strict=True):
                    found = Course(feed.site, float(std) * feed.usual, time, feed.offset)
                    yield Spread(found, size, drop + float(gained) - 2 * self._price, float(std))

    def _times(self, knots: FloatArray) -> list[float]:
        shortest, longest = 2 * (knots[1] - knots[0]), LONGEST * (self._time[-1] - self._time[0])
        return [float(t) for t in np.geomspace(shortest, max(longest, shortest), TIMES)]


def drops(information: FloatArray, along: FloatArray, root: FloatArray, stds: FloatArray = STDS) -> FloatArray:
    """The drop that a course brings with each of some standard deviations (s,); from X'V^-1 X, X'V^-1 e, and L."""
    strength, turned = _axes(information, root)
    return gains_beside(strength, turned.T @ (root.T @ along), np.zeros((0, len(strength))), stds)


def gains_beside(strength: FloatArray, along: FloatArray, beside: FloatArray, stds: FloatArray = STDS) -> FloatArray:
    """The drop that a course brings beside constants, in the axes in which it alone has no cross terms.

    With the strengths D of the course along its axes, M = I + s^2 D, and what the constants take of it, W'W::

        drop = s^2 a'(M - s^2 W'W)^-1 a - log det(M - s^2 W'W)

    by the matrix inversion lemma, so that only a matrix of the size of the constants is solved for each s.

    Parameters
    ----------
    strength, along
        Strengths (k,), and the course's share a (k,) in V^-1 e, along each axis.
    beside
        W (c, k).
    stds
        Standard deviations s that are tried (n,).

    Returns
    -------
    FloatArray
        A drop for each (n,).
    """
    squared = stds[:, None] ** 2
    grown = 1 + squared * strength
    gains: FloatArray = np.sum(squared * along**2 / grown, axis=1) - np.sum(np.log(grown), axis=1)
    if not len(beside):
        return gains
    scaled = beside * (squared / grown)[:, None, :]
    left = np.eye(len(beside)) - scaled @ beside.T
    taken = scaled @ along
    gains += np.sum(taken * np.linalg.solve(left, taken[..., None])[..., 0], axis=1) - np.linalg.slogdet(left)[1]
    return gains


def _axes(information: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
    strength, turned = np.linalg.eigh(root.T @ information @ root)
    return np.maximum(strength, 0.0), turned
