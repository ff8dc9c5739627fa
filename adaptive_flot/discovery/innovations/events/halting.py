"""When a part did not follow what it was asked: one level between two times, from the innovations.

Between the times the value v is replaced by a level L. Both columns of the regression, v and 1 between the times, are
differences of the responses to steps, so that all pairs of edges are compared through matrices of products, as those of
a switch are (`switching.py`).

The filter follows a sensor, so that v is what a sensor shows, and nothing tells it from its level. A sensor that has
stopped is known by what it shows: nothing but noise about one level, for long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.discovery.innovations.events.switching import SHORTEST, IntArray
from adaptive_flot.greybox.model import FloatArray

MOST_EDGES = 300
"""Most times between which a halt is looked for. A longer record has a coarse grid, then a fine one at the best."""
LEAST_SHARE = 0.2
"""Share of the change from v to L that a regression must find at least; far from the truth it finds too little."""
SINGULAR = 1e-6
"""Least determinant of the two columns, as a share of the product of their squares: else v is a constant there."""
STILL, MOVES = 1.5, 5.0
"""Spread of a sensor in its noise from row to row, up to which it is still, and from which it has moved otherwise."""
NEAR, FEW, MOST = 4.0, 10, 0.8
"""Distance from its level in its noise, and the share of a few rows that are so near: the others are outliers."""
LONG = 0.03
"""Share of the rows for which a sensor is still at least."""


@dataclass(frozen=True)
class Halt:
    """A halt of one part.

    Attributes
    ----------
    begin, end
        First interval in which it stands, and first in which it moves again (the number of intervals where it does
        not).
    level
        Its value between them.
    gain
        Of the log-likelihood over the model without, with the spread of the innovations fitted in both.
    beyond
        What of it the best constant amount or factor between any two times does not gain.
    """

    begin: int
    end: int
    level: float
    gain: float
    beyond: float


def best_halt(
    responses: tuple[FloatArray, FloatArray],
    edges: IntArray,
    innovations: FloatArray,
    count: int,
    rows: int,
    limits: tuple[float, float],
) -> Halt | None:
    """Find the halt that explains most; None where none has a level within its limits.

    With ``e = -s a + s L b`` for the responses a to v and b to 1 between the times, the share s and s L are linear::

        gain = n / 2 log(|e|^2 / (|e|^2 - explained))

    Parameters
    ----------
    responses
        Response to steps of v, and to steps of 1, at each edge (m, g) each, what the constants explain projected out.
    edges
        First interval of each step, rising (g,).
    innovations
        What is to be explained (m,), projected likewise.
    count
        Number of intervals.
    rows
        Number n of values that count in the likelihood.
    limits
        Range of the level.
    """
    v, one = responses
    ends = np.append(edges, count)  # the last edge is the end of the record: a step that never comes
    aa, bb = (_pulse_products(np.pad(x.T @ x, (0, 1))) for x in (v, one))
    ab = _pulse_products(np.pad(v.T @ one, (0, 1)))
    ya, yb = ((y[:, None] - y[None, :]) for y in (np.append(x.T @ innovations, 0.0) for x in (v, one)))
    total = float(innovations @ innovations)
    det = aa * bb - ab**2
    long = (ends[None, :] - ends[:, None]) >= SHORTEST
    free = long & (det > SINGULAR * aa * bb) & (det > 0)
    with np.errstate(all="ignore"):
        share, moved = -(bb * ya - ab * yb) / det, (aa * yb - ab * ya) / det
        level, explained = moved / share, -share * ya + moved * yb
        free &= (share >= LEAST_SHARE) & (level >= limits[0]) & (level <= limits[1])
        explained = np.where(free & np.isfinite(explained), explained, 0.0)
        constants = np.where(long, np.fmax(ya**2 / aa, yb**2 / bb), 0.0)
    i, j = divmod(int(np.argmax(explained)), explained.shape[1])
    if not explained[i, j] > 0:
        return None

    def gain(part: float) -> float:
        return rows / 2 * float(np.log(total / max(total - part, 1e-9 * total)))

    most, constant = gain(float(explained[i, j])), float(constants[np.isfinite(constants)].max(initial=0.0))
    return Halt(int(ends[i]), int(ends[j]), float(level[i, j]), most, most - gain(constant))


def _pulse_products(G: FloatArray) -> FloatArray:
    """Products of the same pulse of two courses, for all pairs of edges, from those of their steps (g, g)."""
    diagonal = np.diag(G)
    found: FloatArray = diagonal[:, None] + diagonal[None, :] - G - G.T
    return found


def still_stretch(shown: FloatArray, noise: float) -> tuple[int, int, float] | None:
    """Find the longest stretch in which a sensor that moves otherwise shows nothing but noise about one level.

    Parameters
    ----------
    shown
        What it shows, row by row (n,); NaN where it is missing.
    noise
        Its noise from row to row.

    Returns
    -------
    tuple or None
        First row, first row after it, and the level; None where there is none of LONG of the rows.
    """
    there = np.flatnonzero(np.isfinite(shown))
    y = shown[there]
    least = max(int(LONG * len(shown)), 10)
    if len(y) < 2 * least or not noise > 0 or not y.std() > MOVES * noise:
        return None
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (y - y.mean(), (y - y.mean()) ** 2))
    best, a = (0, 0), 0
    for b in range(1, len(y) + 1):
        # the first row moves up until the rest is still: a stretch within a still one is still, but for chance
        while (squares[b] - squares[a]) / (b - a) - ((sums[b] - sums[a]) / (b - a)) ** 2 > (STILL * noise) ** 2:
            a += 1
        best = max(best, (a, b), key=lambda s: s[1] - s[0])
    a, b = best
    if b - a < least:
        return None
    level = float(np.median(y[a:b]))
    a, b = _over_outliers(np.abs(y - level) <= NEAR * noise, a, b)
    return int(there[a]), int(there[b - 1]) + 1, level


def _over_outliers(near: BoolArray, a: int, b: int) -> tuple[int, int]:
    """The stretch, longer where most of the next few rows (FEW) on either side are near its level, too (n,)."""
    while (k := _more(near[:a][::-1])) > 0:
        a -= k
    while (k := _more(near[b:])) > 0:
        b += k
    return a, b


def _more(near: BoolArray) -> int:
    """How many of the next few rows go on with it: up to the last of them that is near, where most before it are."""
    share = np.cumsum(near[:FEW]) / np.arange(1, min(FEW, len(near)) + 1)
    return int(max(np.flatnonzero(near[:FEW] & (share >= MOST)) + 1, default=0))
