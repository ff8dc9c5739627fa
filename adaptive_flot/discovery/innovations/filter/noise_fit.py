"""How large process and measurement noise are: two numbers, by maximum likelihood.

Measurement noise is rho times the noise from row to row, process noise theta times the scale of each state. With a
number for each state and output the likelihood of a model that is wrong has many maxima, some of them absurd.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from adaptive_flot.greybox.filtering import NoiseModel
from adaptive_flot.greybox.model import FloatArray, Model

THETA = (1e-6, 10.0)
"""Range of process noise, in scales of the states per square root of the time that the record samples."""
RHO = (0.3, 10.0)
"""Range of measurement noise, in that from row to row."""
THETAS, RHOS = (1e-4, 1e-3, 4e-3, 0.02, 0.05, 0.15, 0.4, 1.5), (0.6, 1.0, 1.6)
"""Sizes that a search looks at first. Without process noise the cost is a plain that leads nowhere."""
ELSEWHERE = 0.25
"""Change of the logarithm of rho after which it looks at all of theta again."""
ROUNDS = 10
"""Most steps."""
NEAR = np.array([0.1, 0.05])
STENCIL = np.array([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1)], dtype=float)
"""Distances in the logarithms of theta and rho for differences, and the points that these take beside the middle."""
LONGEST = 20.0
"""Longest step along a direction, in near distances."""
SHARES = (1.0, 0.5, 0.25, 2.0)
"""Shares of a step that are tried."""
ENOUGH = 0.3
"""Gain of a step that does not count."""
LITTLE = 0.02
"""Gain that a step promises below which it is not tried."""
FLAT, TINY = 1e-3, 1e-9
"""Least curvature that counts, as a share of the largest, and in itself."""
PROMISED = 0.05
"""Gain by costs that are nearly right that is not tried."""
COURSES = 4
"""Most runs along which a search looks."""
BETWEEN = (1.0, 0.6, 0.3, 0.1)
"""Shares of the way to what a search along a course has found that are tried."""
KEPT_PROMISE = 0.25
"""Share of a promised gain that is enough."""
Costs = Callable[[Sequence[tuple[float, float]]], Sequence[float]]
Point = tuple[float, float]
"""Logarithms of theta and rho."""


def noise_of(
    model: Model, floor: FloatArray, columns: tuple[int, ...], dt: float, theta: float, rho: float, nu: float
) -> NoiseModel:
    """Noise model of a sampling interval `dt` [s]; `floor` (m,) is the noise from row to row of the outputs `columns`.

    States of an effect have no process noise: they follow what drives them.
    """
    return NoiseModel(
        {s.name: theta * s.scale / np.sqrt(dt) for s in model.states if "." not in s.name},
        {model.outputs[c].name: rho * float(r) for c, r in zip(columns, floor, strict=True)},
        degrees_of_freedom=nu,
    )


def search_noise(
    costs: Costs, start: tuple[float, float] | None = None, cost: float | None = None, *, near: bool = False
) -> tuple[tuple[float, float], float]:
    """Find theta and rho that minimise a cost: steps of Newton in their logarithms, by differences.

    Where the cost is no bowl, curvatures count by their size (Nocedal & Wright, *Numerical Optimization*, 2006, 3.4).
    Shares of the step are tried, and each noise alone. A step looks at up to eight points at once, twice: filters run
    side by side, so that eight cost little more than one.

    Parameters
    ----------
    costs
        Takes several pairs (theta, rho) at once.
    start
        Where to begin; default the best of a grid.
    cost
        The cost there, where it is known.
    near
        Do not look all over first: for a search that is called again after something else has moved.

    Returns
    -------
    tuple
        The pair, and its cost.
    """
    search = _Search(costs)
    if start is None:
        middle = search.least_of(np.log(list(product(THETAS, RHOS))))
    else:
        middle = search.inside(np.log(start))
        if cost is not None:
            search.seen[middle] = cost
        elif near:
            search.least_of([middle])
    looked, gain = middle[1] if near else np.inf, np.inf
    for _ in range(ROUNDS):
        if abs(middle[1] - looked) > ELSEWHERE:
            looked, middle = middle[1], search.least_of([middle, *_all_over(middle)])
        elif gain < ENOUGH:
            break
        before, at = search.seen[middle], search.off_the_ends(middle)
        middle = search.least_of([at, *(at + NEAR * STENCIL)])
        steps, promised = search.steps_from(at)
        if promised >= LITTLE:
            middle = search.least_of(steps)
        gain = before - search.seen[middle]
    return _sizes(middle), search.seen[middle]


def search_noise_along(
    costs: Costs,
    along: Callable[[tuple[float, float]], Costs],
    start: tuple[float, float] | None = None,
    cost: float | None = None,
    *,
    near: bool = False,
) -> tuple[tuple[float, float], float]:
    """The same, by costs that are right at one pair and nearly right elsewhere, and take little time.

    What these find is tried, and looked from again, until it gains nothing that counts. Where they promise a gain that
    is not there, the search goes on without them: so none ends above where it began.

    Parameters
    ----------
    costs, start, cost, near
        As `search_noise` has them.
    along
        The costs that are right at a pair.

    Returns
    -------
    tuple
        The pair, and its cost.
    """
    if start is None or cost is None:
        first = _Search(costs)
        middle = first.least_of(np.log(list(product(THETAS, RHOS))) if start is None else [np.log(start)])
        start, cost = _sizes(middle), first.seen[middle]
    for _ in range(COURSES):
        found, promised = search_noise(along(start), start, cost, near=near)
        if promised > cost - PROMISED:
            return start, cost
        begin, before, least = start, cost, cost - (cost - promised) * KEPT_PROMISE
        way = np.log(found) - np.log(begin)
        for shares in (BETWEEN[:1], BETWEEN[1:]):  # mostly the first
            tried = [_sizes(np.log(begin) + share * way) for share in shares]
            values = list(costs(tried))
            if min(values) < cost:
                start, cost = tried[int(np.argmin(values))], min(values)
            if cost <= least:
                break
        else:
            return search_noise(costs, start, cost, near=near)
        if before - cost < ENOUGH:
            break
        near = True
    return start, cost


def _sizes(point: ArrayLike) -> tuple[float, float]:
    theta, rho = np.exp(point).tolist()
    return theta, rho


def _all_over(middle: Point) -> list[Point]:
    """All of theta at the same rho and at another one; but for the size nearest to the middle itself."""
    thetas = np.log(THETAS)
    others = np.delete(thetas, np.argmin(np.abs(thetas - middle[0])))
    elsewhere = np.log(RHOS[-1] if middle[1] < np.log(RHOS[1]) else RHOS[0])
    return [*((theta, middle[1]) for theta in others.tolist()), *((theta, elsewhere) for theta in thetas.tolist())]


class _Search:
    """The points (log theta, log rho) that were tried, with their costs."""

    def __init__(self, costs: Costs) -> None:
        self._costs, self._ends = costs, np.log([THETA, RHO]).T
        self.seen: dict[Point, float] = {}

    def inside(self, point: ArrayLike) -> Point:
        """The nearest point in range; rounded, so that what is tried by two ways is one point."""
        theta, rho = np.clip(np.round(np.asarray(point, dtype=float), 9), *self._ends).tolist()
        return theta, rho

    def off_the_ends(self, point: Point) -> FloatArray:
        """The nearest point from which differences stay in range."""
        return np.asarray(self.inside(np.clip(point, self._ends[0] + NEAR, self._ends[1] - NEAR)))

    def least_of(self, points: Iterable[ArrayLike]) -> Point:
        """Where the cost is least so far, when these points were tried too."""
        new = [at for at in dict.fromkeys(self.inside(point) for point in points) if at not in self.seen]
        if new:
            found = self._costs([(float(np.exp(theta)), float(np.exp(rho))) for theta, rho in new])
            self.seen.update(zip(new, found, strict=True))
        return min(self.seen, key=self.seen.__getitem__)

    def steps_from(self, at: FloatArray) -> tuple[list[FloatArray], float]:
        """Where steps of Newton from a point may lead, from the differences about it, and what a whole one promises."""
        east, west, north, south, both, neither = (self.seen[self.inside(at + NEAR * move)] for move in STENCIL)
        middle = self.seen[self.inside(at)]
        slope = np.array([east - west, north - south]) / 2
        across = (both + neither - east - west - north - south) / 2 + middle
        bends = np.array([[east + west - 2 * middle, across], [across, north + south - 2 * middle]])
        curvature, directions = np.linalg.eigh(bends)
        size = np.maximum(np.abs(curvature), max(FLAT * np.abs(curvature).max(), TINY))
        parts = directions * np.clip(-(directions.T @ slope) / size, -LONGEST, LONGEST)
        alone = np.diag(np.clip(-slope / np.maximum(np.abs(np.diag(bends)), TINY), -LONGEST, LONGEST))
        whole = parts.sum(axis=1)
        promised = float(np.sum((directions.T @ slope) ** 2 / size)) / 2
        return [at + NEAR * move for move in (*(share * whole for share in SHARES), *parts.T, *alone)], promised
