"""An output whose noise becomes several times as large, or as small, at some time: a sensor that comes loose.

One size of the noise for the whole record believes the noisy rows too much. Chance draws a small effect there then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.record.robust import clipped_std
from adaptive_flot.greybox.model import FloatArray

FEWEST = 60
"""Differences on either side of a change."""
TRIED = 80
"""Times that are tried, evenly over the rows."""
LEAST_RATIO = 3.0
"""Noise on one side, over that on the other. Less is told from an operating point that is noisier by no record."""
LEAST_GAIN = 60.0
"""Drop of minus two log-likelihood. With heavy tails it counts some large values; the best of TRIED times is taken."""
WHITE = -0.25
"""Differences of white noise have a correlation of -0.5 from row to row. What moves from row to row has more."""


@dataclass(frozen=True)
class NoiseChange:
    """A change of the noise of a measured output.

    Attributes
    ----------
    column
        Index of the output among those that are measured.
    row
        First row with the noise after the change.
    ratio
        Noise after the change over that before.
    """

    column: int
    row: int
    ratio: float


def noise_changes(residual: FloatArray) -> tuple[NoiseChange, ...]:
    """The outputs whose noise changes once, by LEAST_RATIO or more.

    By differences d of the residual, in which slow errors of a model cancel. With their standard deviations s, s_1 and
    s_2 over all n, the first n_1 and the other n_2 of them (Huber's, see `clipped_std`), the time is that of the
    largest gain::

        n log s^2 - n_1 log s_1^2 - n_2 log s_2^2

    Chen & Gupta, *J. Am. Statist. Assoc.* 92 (1997) 739. Only noise that is white from row to row counts: a model that
    lacks something fast is wrong by more where the inputs move more.

    Parameters
    ----------
    residual
        Measured minus predicted (N, m), NaN where it does not count.
    """
    found = (_change(j, e) for j, e in enumerate(residual.T))
    return tuple(change for change in found if change is not None)


def noise_levels(changes: Sequence[NoiseChange], rows: int, columns: int) -> FloatArray:
    """Relative size of the noise (rows, columns): 1 on the quieter side of a change, and else its ratio."""
    levels = np.ones((rows, columns))
    for change in changes:
        after = np.arange(rows) >= change.row
        levels[after if change.ratio > 1 else ~after, change.column] = max(change.ratio, 1 / change.ratio)
    return levels


def _change(column: int, residual: FloatArray) -> NoiseChange | None:
    d = np.diff(residual)
    at = np.flatnonzero(np.isfinite(d))
    if len(at) < 2 * FEWEST:
        return None
    d, all_of = d[at], clipped_std(d[at])
    tried = np.unique(np.linspace(FEWEST, len(at) - FEWEST, TRIED).astype(int))
    sizes = np.array([(clipped_std(d[:k]), clipped_std(d[k:])) for k in tried])
    if not (all_of > 0 and (sizes > 0).all()):
        return None
    gains = 2 * (len(at) * np.log(all_of) - tried * np.log(sizes[:, 0]) - (len(at) - tried) * np.log(sizes[:, 1]))
    best = int(np.argmax(gains))
    (before, after), k = sizes[best], int(tried[best])
    if gains[best] < LEAST_GAIN or max(before, after) < LEAST_RATIO * min(before, after):
        return None
    noisy = slice(k, None) if after > before else slice(None, k)
    if not _is_white(d[noisy], at[noisy], float(max(before, after))):
        return None
    return NoiseChange(column, int(at[k]) + 1, float(after / before))


def _is_white(d: FloatArray, at: NDArray[np.intp], std: float) -> bool:
    """Whether differences (k,) at rows (k,) are those of noise without a memory."""
    together = np.diff(at) == 1
    z = np.clip(d, -3 * std, 3 * std)
    squares = float(np.mean(z**2))
    return together.sum() >= FEWEST // 2 and float(np.mean(z[:-1][together] * z[1:][together])) <= WHITE * squares
