"""Pairs of signals: correlation, and whether an input is set from an output."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from adaptive_flot.greybox.quantities import FloatArray

MOST_LAGS = 60
FEWEST = 50
"""Rows from which a relation can be judged."""
FEEDBACK_LAGS = 5
ROWS_PER_LAG = 10
"""Fewest rows for each lag of the input itself."""
LEAST_SHARE = 0.01
"""Share of an input's one-step variance that an output must explain to count as feedback."""
SIGNIFICANCE = 1e-3


@dataclass(frozen=True)
class Correlation:
    """Largest correlation coefficient of two signals over the lags, and that lag [rows] (`one` leads)."""

    one: str
    other: str
    r: float
    lag: int


@dataclass(frozen=True)
class Feedback:
    """How much of the moves of an input past values of an output explain.

    Attributes
    ----------
    input, output
        The two.
    share
        Share of the variance that is left after the input's own past.
    p_value
        Probability of as large a share by chance.
    """

    input: str
    output: str
    share: float
    p_value: float

    @property
    def closed(self) -> bool:
        """Whether the input counts as set from the output."""
        return self.share > LEAST_SHARE and self.p_value < SIGNIFICANCE


def correlation(one: str, other: str, a: FloatArray, b: FloatArray, lags: int = MOST_LAGS) -> Correlation | None:
    """Largest correlation of a[k - lag] with b[k] over lags 0 to `lags`; None where a signal does not move."""
    best: Correlation | None = None
    for lag in range(min(lags, len(a) // 5) + 1):
        x, y = a[: len(a) - lag], b[lag:]
        both = np.isfinite(x) & np.isfinite(y)
        if both.sum() < FEWEST:
            continue
        x, y = x[both] - x[both].mean(), y[both] - y[both].mean()
        size = float(np.sqrt((x @ x) * (y @ y)))
        if size <= 0 or _still(a) or _still(b):
            return None
        r = float(x @ y) / size
        if best is None or abs(r) > abs(best.r) + 1e-3:
            best = Correlation(one, other, r, lag)
    return best


def feedback(name: str, output: str, u: FloatArray, y: FloatArray) -> Feedback | None:
    """Whether past outputs predict an input (N,) beyond its own past; None where it can not be told.

    An output remembers the far past of an input, and that tells an input of a few frequencies. So only what is new in
    the output counts, e: what q lags of the input, and p of the output itself, leave of it. Then two regressions, with
    and without it; the output is held where it is missing::

        y[k] = sum_i f_i u[k-i] + sum_i g_i y[k-i] + c + e[k]
        u[k] = sum_i a_i u[k-i] + c + e0,      u[k] = sum_i a_i u[k-i] + sum_i b_i e[k-i] + c + e1
        share = 1 - RSS1 / RSS0,               F = (RSS0 - RSS1) / p / (RSS1 / (n - p - q - 1))


    Granger, *Econometrica* 37 (1969) 424; as a test of feedback Caines & Chan, *IEEE Trans. Autom. Control* 20 (1975)
    498. Where lags depend on each other, the ranks of the regressions stand for q and p + q. A feedback that acts
    within a row is not seen.
    """
    held = _held(y)
    first = int(np.argmax(np.isfinite(held))) if np.isfinite(held).any() else len(held)
    u, held = u[first:], held[first:]
    p = FEEDBACK_LAGS
    q = max(p, min(MOST_LAGS, len(u) // ROWS_PER_LAG))
    n = len(u) - q - p
    if n < FEWEST or _still(u) or _still(held):
        return None
    inputs, outputs = _lagged(u, q, range(q + 1)), _lagged(held, q, range(1, p + 1))
    # what no input has brought about
    new, _ = _residual(_scaled(np.column_stack([inputs, outputs])), _scaled(held[q:]))
    own, other, target = (_scaled(a) for a in (inputs[p:, 1:], _lagged(new, p, range(1, p + 1)), u[q + p :]))
    e0, rank0 = _residual(own, target)
    e1, rank1 = _residual(np.column_stack([own, other]), target)
    rss0, rss1 = float(e0 @ e0), float(e1 @ e1)
    if rss0 <= 1e-20 * n or rank1 == rank0:
        return None
    more, left = rank1 - rank0, n - rank1 - 1
    share = max(0.0, 1 - rss1 / rss0)
    ratio = (rss0 - rss1) / more / (max(rss1, 1e-300) / left)
    p_value = float(f_distribution.sf(ratio, more, left))
    return Feedback(name, output, float(share), p_value)


def _lagged(values: FloatArray, first: int, lags: Iterable[int]) -> FloatArray:
    """Values (N,) as they were so many rows before each row from the first on (N - first, lags)."""
    return np.column_stack([values[first - i : len(values) - i] for i in lags])


def _residual(design: FloatArray, target: FloatArray) -> tuple[FloatArray, int]:
    """What a regression leaves of a target (n,), and its rank; all columns are about their means."""
    coefficients, _, rank, _ = np.linalg.lstsq(design, target, rcond=1e-10)
    return target - design @ coefficients, int(rank)


def block_means(values: FloatArray, size: int) -> FloatArray:
    """Means of blocks of `size` rows, missing values left out; a block without any is missing.

    >>> block_means(np.array([1.0, 3.0, np.nan, 5.0, 7.0]), 2).tolist()
    [2.0, 5.0]
    """
    if size == 1:
        return values
    blocks = values[: len(values) // size * size].reshape(-1, size)
    seen = np.isfinite(blocks)
    total = np.where(seen, blocks, 0.0).sum(axis=1)
    return np.where(seen.any(axis=1), total / np.maximum(seen.sum(axis=1), 1), np.nan)


def _still(values: FloatArray) -> bool:
    seen = values[np.isfinite(values)]
    return len(seen) == 0 or float(np.ptp(seen)) <= 1e-9 * max(float(np.max(np.abs(seen))), 1e-300)


def _scaled(values: FloatArray) -> FloatArray:
    centred = values - values.mean(axis=0)
    found: FloatArray = centred / np.maximum(np.std(values, axis=0), 1e-300)
    return found


def _held(values: FloatArray) -> FloatArray:
    """Values with each missing one replaced by the last one before it."""
    place = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(place >= 0, values[np.maximum(place, 0)], np.nan)
