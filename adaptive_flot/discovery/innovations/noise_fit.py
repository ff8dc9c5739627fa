"""How large process and measurement noise are: two numbers, by maximum likelihood.

Measurement noise is rho times the noise from row to row, process noise theta times the scale of each state. With a
number for each state and output the likelihood of a model that is wrong has many maxima, some of them absurd.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from adaptive_flot.greybox.filtering import NoiseModel
from adaptive_flot.greybox.model import FloatArray, Model

THETA = (1e-6, 10.0)
"""Range of process noise, in scales of the states per square root of the time that the record samples."""
RHO = (0.3, 10.0)
"""Range of measurement noise, in that from row to row."""
COARSE, ROUNDS, PRECISION = 7, 2, 0.05
"""Grid of the first search, rounds of the two in turn, and width at which a search in the logarithm ends."""


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
    cost: Callable[[float, float], float], start: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Find theta and rho that minimise a cost: on a grid and by golden sections, or, from a start, near it."""
    if start is None:
        grid = np.geomspace(*THETA, COARSE)
        theta = float(min(grid, key=lambda t: cost(float(t), 1.0)))
        rho, width = 1.0, float(np.log(grid[1] / grid[0]))
    else:
        (theta, rho), width = start, 1.0
    for _ in range(ROUNDS):
        theta = _golden(partial(_first, cost, rho), theta, width, THETA)
        rho = _golden(partial(cost, theta), rho, width / 2, RHO)
        width /= 3
    return theta, rho


def _first(cost: Callable[[float, float], float], rho: float, theta: float) -> float:
    return cost(theta, rho)


def _golden(cost: Callable[[float], float], at: float, width: float, ends: tuple[float, float]) -> float:
    low, high = max(np.log(at) - width, np.log(ends[0])), min(np.log(at) + width, np.log(ends[1]))
    found = minimize_scalar(
        lambda x: cost(float(np.exp(x))), bounds=(low, high), method="bounded", options={"xatol": PRECISION}
    )
    best: float = float(np.exp(found.x))
    return best if found.fun <= cost(at) else at
