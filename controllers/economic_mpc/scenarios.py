"""What may be otherwise than the estimate says: parameters and output errors along the axes that move limited outputs.

The uncertain quantities are the adapted parameters, with the covariance of the estimate, and the error of each limited
output after a move, with the spread that past plans had (`Misfit`). Their joint covariance is S S'. With the
steady-state derivatives G of the limited outputs, the singular value decomposition ``G S = U D V'`` gives the axes
``S V``: the first ones move limited outputs most, the others not at all (to first order). Scenarios are a grid of three
points on the first axes: the estimate, and ``quantile`` standard deviations to both sides.

A positive parameter with a dimension goes by a factor, ``theta exp(d / theta)`` for a change d. Estimators have its
logarithm as coordinate, and there the line is straight along which such a parameter makes up for another one. A wide
covariance would else place scenarios at values below zero, or far from that line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from adaptive_flot.contracts import Plan
from adaptive_flot.greybox.model import FloatArray

MEMORY = 20
"""Plans over which the spread of their errors is estimated."""


@dataclass(frozen=True)
class Misfit:
    """How far limited outputs came out from what was planned for the end of a move.

    Attributes
    ----------
    expected
        Time [s] and outputs (k,) that the newest plan gives for the end of its first move; None without one.
    variance
        Mean square of the errors (k,).
    count
        Plans that it rests on, at most `MEMORY`.
    """

    expected: tuple[float, tuple[float, ...]] | None
    variance: tuple[float, ...]
    count: int = 0

    @classmethod
    def none(cls, outputs: int) -> Misfit:
        """Nothing was planned yet."""
        return cls(None, (0.0,) * outputs)

    def after(self, time: float, came: FloatArray, dt: float) -> Misfit:
        """One comparison later, if the newest plan was for this time; `came` are the outputs (k,) without noise."""
        if self.expected is None or abs(self.expected[0] - time) > dt / 2:
            return self
        error = came - np.array(self.expected[1])
        if not np.isfinite(error).all():
            return Misfit(None, self.variance, self.count)
        count = min(self.count + 1, MEMORY)
        before = np.array(self.variance)
        variance = before + (error**2 - before) / count
        return Misfit(None, tuple(variance.tolist()), count)

    def planned(self, plan: Plan, outputs: tuple[str, ...]) -> Misfit:
        """Remember what a plan gives for the end of its first move."""
        first = tuple(float(plan.outputs[name][0]) for name in outputs)
        return Misfit((float(plan.time[0]), first), self.variance, self.count)


@dataclass(frozen=True)
class Scenarios:
    """Points of the grid, the estimate first.

    Attributes
    ----------
    parameters
        Adapted parameters of each (S, q).
    biases
        What is added to the error of each limited output (S, k).
    """

    parameters: FloatArray
    biases: FloatArray

    @property
    def are_alike(self) -> bool:
        """Whether all are the estimate."""
        return bool((self.parameters == self.parameters[0]).all() and not self.biases.any())


def grid(
    theta: FloatArray,
    covariance: FloatArray,
    spread: FloatArray,
    gains: FloatArray,
    axes: int,
    quantile: float,
    by_factor: Sequence[bool] = (),
) -> Scenarios:
    """Scenarios on a grid.

    Parameters
    ----------
    theta, covariance
        Adapted parameters (q,) and their covariance (q, q).
    spread
        Standard deviation of the error of each limited output (k,).
    gains
        Steady-state derivatives of the limited outputs by the parameters (k, q).
    axes
        Number a of axes; there are 3^a scenarios. Axes beyond q + k have no length.
    quantile
        Distance of the outer points, in standard deviations.
    by_factor
        Whether each parameter goes by a factor (q,); default none.
    """
    q, k = len(theta), len(spread)
    values, vectors = np.linalg.eigh(covariance)
    root = np.zeros((q + k, q + k))
    root[:q, :q] = vectors * np.sqrt(np.maximum(values, 0.0))
    root[q:, q:] = np.diag(spread)
    effect = np.hstack([gains, np.eye(k)]) @ root
    found = np.zeros((q + k, axes))
    found[:, : min(axes, q + k)] = _axes(effect, root)[:, :axes]
    points = np.array(sorted(product((0.0, -1.0, 1.0), repeat=axes), key=lambda at: sum(map(abs, at))))
    moved = quantile * points @ found.T
    parameters = theta + moved[:, :q]
    for i in (i for i, goes in enumerate(by_factor) if goes and theta[i] > 0):
        parameters[:, i] = theta[i] * np.exp(moved[:, i] / theta[i])
    return Scenarios(parameters, moved[:, q:])


def _axes(effect: FloatArray, root: FloatArray) -> FloatArray:
    """Axes (q + k, q + k), each with its side: a plan that was made for one side is no start for the other.

    Those that move outputs come first, upwards; then the others, by their share of the standard deviations.
    """
    directions = np.linalg.svd(effect, full_matrices=True)[2].T
    k, std = len(effect), np.linalg.norm(root, axis=1)
    first, rest = root @ directions[:, :k], directions[:, k:]
    share = np.divide(root, std[:, None], out=np.zeros_like(root), where=std[:, None] > 0)
    rest = root @ rest @ np.linalg.svd(share @ rest)[2].T
    up = [(effect @ directions[:, :k]), np.divide(rest, std[:, None], out=np.zeros_like(rest), where=std[:, None] > 0)]
    sides = [np.sign(each[np.abs(each).argmax(axis=0), np.arange(each.shape[1])]) for each in up]
    return np.hstack([first, rest]) * np.where(np.concatenate(sides) < 0, -1.0, 1.0)
