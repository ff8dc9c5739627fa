"""How large process and measurement noise are: two numbers, by maximum likelihood.

Measurement noise is rho times the noise from row to row, process noise theta times the scale of each state. With a
number for each state and output the likelihood of a model that is wrong has many maxima, some of them absurd.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from adaptive_flot.greybox.filtering import NoiseModel
from adaptive_flot.greybox.model import FloatArray, Model

THETA = (1e-6, 10.0)
"""Range of process noise, in scales of the states per square root of the time that the record samples."""
RHO = (0.3, 10.0)
"""Range of measurement noise, in that from row to row."""
COARSE, ROUNDS, MOVES = 7, 8, 8
"""Grid of the first search, most rounds of the two in turn, and most moves of one search."""
ENOUGH, NARROWEST = 0.5, 0.1
"""Gain of a round that does not count, and the least distance in the logarithm at which one looks."""
Costs = Callable[[Sequence[tuple[float, float]]], Sequence[float]]
FIRST_WIDTH = 1.0
"""Distance in the logarithm at which a search from a known size looks first; a third of it in the next round."""


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


def search_noise(costs: Costs, start: tuple[float, float] | None = None) -> tuple[float, float]:
    """Find theta and rho that minimise a cost: on a grid, then each in turn by parabolas in its logarithm.

    After each round the step of both is tried once more: one noise may stand for the other (Hooke & Jeeves, *J. ACM* 8
    (1961) 212). Rounds end when one gains nothing that counts. `costs` takes several pairs (theta, rho) at once.
    """
    if start is None:
        grid = [(float(t), 1.0) for t in np.geomspace(*THETA, COARSE)]
        values = costs(grid)
        at, best = grid[int(np.argmin(values))], min(values)
        width = float(np.log(grid[1][0] / grid[0][0])) / 2
    else:
        at, best, width = start, costs([start])[0], FIRST_WIDTH
    for _ in range(ROUNDS):
        before, first = best, at
        theta, best = _by_parabolas(_along(costs, rho=at[1]), at[0], best, width, THETA)
        rho, best = _by_parabolas(_along(costs, theta=theta), at[1], best, min(width, FIRST_WIDTH) / 2, RHO)
        at = theta, rho
        if at != first:
            further = float(np.clip(theta**2 / first[0], *THETA)), float(np.clip(rho**2 / first[1], *RHO))
            (again,) = costs([further])
            at, best = (further, again) if again < best else (at, best)
        if before - best < ENOUGH and width < FIRST_WIDTH:
            break
        width = max(width / 3, NARROWEST)
    return at


def _along(costs: Costs, theta: float | None = None, rho: float | None = None) -> Callable[[list[float]], list[float]]:
    """The costs along one of the two, the other one being given."""

    def of(values: list[float]) -> list[float]:
        pairs = [(v if theta is None else theta, v if rho is None else rho) for v in values]
        return list(costs(pairs)) if pairs else []

    return of


def _by_parabolas(
    costs: Callable[[list[float]], list[float]], at: float, value: float, width: float, ends: tuple[float, float]
) -> tuple[float, float]:
    """Where a cost is least near a point with a known value, and its value there.

    The lowest of three points a `width` of the logarithm apart is moved on to, until it is the middle one. Then the
    parabola through the three says where to look once more (Brent, *Algorithms for Minimization without Derivatives*,
    1973, chapter 5). An end of the range may be the lowest.
    """
    low, high = (float(np.log(end)) for end in ends)
    middle = float(np.log(at))
    seen = {middle: value}

    def look(*points: float) -> None:
        new = [x for x in dict.fromkeys(points) if x not in seen]
        seen.update(zip(new, costs([float(np.exp(x)) for x in new]), strict=True))

    for _ in range(MOVES):
        left, right = max(middle - width, low), min(middle + width, high)
        look(left, right)
        lowest = min((middle, left, right), key=seen.__getitem__)
        if lowest == middle:
            break
        middle = lowest
    if left < middle < right:
        a, b = (seen[middle] - seen[left]) / (middle - left), (seen[right] - seen[middle]) / (right - middle)
        if b > a:
            look(min(max((left + middle) / 2 - a * (right - left) / 2 / (b - a), left), right))
    best = min(seen, key=seen.__getitem__)
    return float(np.exp(best)), seen[best]
