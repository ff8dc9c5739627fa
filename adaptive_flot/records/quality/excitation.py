"""Each input: whether it moves, and how richly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz

from adaptive_flot.greybox.quantities import FloatArray

LEAST_MOVE = 5e-3
"""Spread over mean below which an input does not move, as in discovery's data screening."""
LEAST_RANGE = 0.02
"""Spread over mean below which it hardly moves."""
HIGHEST_ORDER = 20
LEAST_EIGENVALUE = 1e-3
"""Smallest eigenvalue, as a share of the variance, from which a covariance matrix counts as regular."""


@dataclass(frozen=True)
class Excitation:
    """How an input moves.

    Attributes
    ----------
    name
        The input.
    share
        Spread (quantiles 0.02 to 0.98) over the mean size.
    moves
        Times it changes by more than a tenth of its spread from one row to the next.
    order
        Order of persistent excitation, at most HIGHEST_ORDER.
    """

    name: str
    share: float
    moves: int
    order: int

    @property
    def word(self) -> str:
        """What that means."""
        if self.share <= LEAST_MOVE:
            return "does not move"
        return "hardly moves" if self.share <= LEAST_RANGE else "moves"


def excitation(name: str, values: FloatArray) -> Excitation:
    """Judge an input (N,) without missing values.

    The order of persistent excitation is the largest n for which the covariance matrix of n values is regular::

        R_n = toeplitz(r(0), ..., r(n-1)),    r(k) = mean (u[i] - m) (u[i+k] - m)

    An input of order 2 n identifies a linear model of n-th order. Ljung, *System Identification* (1999), section 13.2.
    """
    low, high = np.quantile(values, (0.02, 0.98))
    spread = float(high - low)
    size = max(float(np.mean(np.abs(values))), 1e-300)
    moves = int((np.abs(np.diff(values)) > 0.1 * max(spread, 1e-300)).sum()) if spread > 0 else 0
    return Excitation(name, spread / size, moves, _order(values))


def _order(values: FloatArray) -> int:
    centred = values - values.mean()
    n = min(HIGHEST_ORDER, len(values) // 4)
    r = np.array([float(centred[: len(centred) - k] @ centred[k:]) / len(centred) for k in range(n)])
    if n == 0 or r[0] <= 1e-12 * float(np.mean(values**2)):
        return 0
    regular = [k for k in range(1, n + 1) if np.linalg.eigvalsh(toeplitz(r[:k]))[0] > LEAST_EIGENVALUE * r[0]]
    return max(regular, default=0)
