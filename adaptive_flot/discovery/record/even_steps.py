"""Signals that move at even times only: an analyser that serves several streams in turn, and is kept in between.

The record shows it by itself, whatever the model: moves from row to row are large at every P-th row, and between these
rows there is noise only. With the ranks r of the N moves by their size, and the n rows of a comb of interval P::

    z = (mean of r over the comb - (N + 1) / 2) / sqrt((N + 1) (N - n) / (12 n))

(Wilcoxon, *Biometrics* 1:80, 1945). What moves with an input that is switched at even times has large moves there, too.
It goes on between these rows. So the mean of a hold's second half less that of its first must be small beside the step
to the next hold.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from adaptive_flot.greybox.model import FloatArray

SHORTEST, LEAST_HOLDS = 4.0, 16
"""Least interval that is looked for, in rows, and least holds in a record."""
COARSE, REFINED = 1.5, 13
"""Rows between the last steps of one interval that is tried and of the next, and how many around the best."""
FINE = 0.25
"""Rows between the first rows that are tried then."""
MOST_ROWS = 4000
"""Rows that are looked at, the first ones: more would take long, and tell no more."""
SURE = 6.0
"""z from which a comb is no chance, though thousands are tried."""
STILL = 0.1
"""Largest share of the squared moves between two halves of a hold in those to the next hold. One is usual."""


def steps_evenly(values: FloatArray) -> bool:
    """Whether a signal (N,) moves at even times only, but for its noise; NaN where it was not measured."""
    moves = np.abs(np.diff(values))
    seen = np.isfinite(moves)
    moves, seen = moves[:MOST_ROWS], seen[:MOST_ROWS]
    if seen.sum() < SHORTEST * LEAST_HOLDS:
        return False
    ranks = np.full(len(moves), (seen.sum() + 1) / 2)
    ranks[seen] = rankdata(moves[seen])
    sureness, interval, first = _best_comb(ranks)
    return sureness > SURE and _is_still(values, _comb(interval, np.array([first]), len(moves))[0] + 1)


def _comb(interval: float, first: FloatArray, count: int) -> NDArray[np.intp]:
    """Rows of combs (n, holds) with these first rows (n,)."""
    at = first[:, None] + interval * np.arange(int((count - 1) / interval))
    return np.minimum(np.round(at), count - 1).astype(np.intp)


def _best_comb(ranks: FloatArray) -> tuple[float, float, float]:
    """The largest z, the interval and the first row of its comb: over a coarse grid, then around the best of it."""
    count = len(ranks)
    tried, interval = [], SHORTEST
    while interval <= count / LEAST_HOLDS:
        tried.append(_best_first(ranks, interval, np.arange(interval)))
        interval += COARSE * interval / count  # by so many rows the last step moves
    interval = max(tried)[1]
    # a coarse grid may have met every second or third step only
    parts = [interval / k for k in (1, 2, 3) if interval / k >= SHORTEST]
    offset = np.linspace(-COARSE, COARSE, REFINED) * interval / count
    near = [part + moved for part in parts for moved in offset.tolist()]
    return max(_best_first(ranks, each, np.arange(0.0, each, FINE)) for each in near)


def _best_first(ranks: FloatArray, interval: float, first: FloatArray) -> tuple[float, float, float]:
    """The largest z of an interval over these first rows (n,), the interval and the first row."""
    count = len(ranks)
    rows = _comb(interval, first, count)
    n = rows.shape[1]
    z = (ranks[rows].mean(axis=1) - (count + 1) / 2) / np.sqrt((count + 1) * (count - n) / (12 * n))
    k = int(np.argmax(z))
    return float(z[k]), interval, float(first[k])


def _is_still(values: FloatArray, begins: NDArray[np.intp]) -> bool:
    """Whether the signal rests within its holds, which begin at these rows."""
    within, across, before = [], [], None
    for a, b in pairwise(begins.tolist()):
        middle = (a + b) // 2
        halves = values[a:middle], values[middle:b]
        if not all(np.isfinite(half).any() for half in halves):
            before = None
            continue
        early, late = (float(np.nanmedian(half)) for half in halves)
        within.append(late - early)
        if before is not None:
            across.append(early - before)
        before = late
    return len(across) >= LEAST_HOLDS // 2 and _square(within) < STILL * _square(across)


def _square(moves: list[float]) -> float:
    """Mean square of the moves, without the few largest: outliers."""
    squares = np.sort(np.square(moves))
    return float(np.mean(squares[: max(1, int(0.95 * len(squares)))]))
