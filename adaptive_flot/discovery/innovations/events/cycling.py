"""When something is switched on in every period, a day say: one size, one time of the period and one duration.

The response to such a switch is the sum of those in short parts of the period, so all pairs of edges are compared
through one matrix of products, as for a switch (see `switching.py`). The folding at a known period is that of
Stellingwerf, *Astrophys. J.* 224 (1978) 953.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.greybox.model import FloatArray

CALENDAR = (3600.0, 86_400.0, 604_800.0)
"""Periods that people and clocks have [s]: an hour, a day, a week."""
LEAST_PERIODS, LEAST_ROWS = 4, 8
"""Fewest periods in a record, and rows in a period."""
PARTS = 48
"""Parts of a period between which the edges are looked for at first."""
ROUNDS, ZOOM, REACH = 3, 4, 3
"""Rounds in which the edges are looked for in finer steps, how much finer, and how many steps to either side."""
AWAY = (0.0, -0.5, -0.25, 0.25, 0.5)
"""Shifts of a period that are tried where it is no clock's, in periods over the record; then a quarter of them."""
AS_MUCH = 0.98
"""Share of what a switch explains from which its pause explains as much."""
Respond = Callable[[FloatArray], FloatArray]
"""From courses of a change (n, f) to what they explain of the innovations (r, f)."""


@dataclass(frozen=True)
class Cycle:
    """A switch in every period.

    Attributes
    ----------
    period, onset, duration
        Its period, when it is first on, and for how long each time [s].
    size
        Factor of the course while it is on, as fitted by the regression.
    explained
        Squares of the innovations that it explains.
    """

    period: float
    onset: float
    duration: float
    size: float
    explained: float


def is_on(time: FloatArray, period: float, onset: float, duration: float) -> FloatArray:
    """1 at the times [s] (n,) at which it is on, else 0 (n,)."""
    return (np.mod(time - onset, period) < duration).astype(float)


def possible_periods(span: float, dt: float) -> list[float]:
    """Periods of a clock [s] that a record of a length [s] shows often enough."""
    return [p for p in CALENDAR if span >= LEAST_PERIODS * p and p >= LEAST_ROWS * dt]


def best_cycle(
    respond: Respond, innovations: FloatArray, by: FloatArray, time: FloatArray, dt: float, period: float
) -> Cycle | None:
    """Find the switch in every period that explains most.

    Parameters
    ----------
    respond, innovations
        What courses explain of the innovations, and these (r,).
    by, time
        The course of a change that is always on (n,), and the time of each of its rows [s] (n,).
    dt, period
        Sampling interval and period [s].

    Returns
    -------
    Cycle or None
        None where the response is not finite, or nothing explains anything.
    """
    folded = _folded(respond, innovations, by, time, dt, period)
    if folded is None:
        return None
    (onset, duration, explained), step = folded, period / _parts(dt, period)
    found = Cycle(period, onset, duration, 0.0, explained)
    for _ in range(ROUNDS):
        step /= ZOOM
        away = step * np.arange(-REACH, REACH + 1)
        tried = [
            (onset + a, duration - a + b) for a in away for b in away if dt / 2 < duration - a + b < period - dt / 2
        ]
        if not tried:
            return None
        x = respond(by[:, None] * np.column_stack([is_on(time, period, *each) for each in tried]))
        products, squares = innovations @ x, np.einsum("rf,rf->f", x, x)
        gained = np.where(squares > 0, products**2 / np.maximum(squares, 1e-300), 0.0)
        best = int(np.argmax(gained))
        (onset, duration), size = tried[best], float(products[best] / max(squares[best], 1e-300))
        found = Cycle(period, onset, duration, size, float(gained[best]))
    found = _told_shorter(respond, innovations, by, time, found)
    begins = float(time[0]) - dt
    return replace(found, onset=begins + float(np.mod(found.onset - begins, period))) if found.explained > 0 else None


def _told_shorter(respond: Respond, innovations: FloatArray, by: FloatArray, time: FloatArray, found: Cycle) -> Cycle:
    """The pause in place of what is on for most of the period, where that explains as much: a free constant moves then.

    A window that is open at night, and not a loss that is smaller by day.
    """
    if found.duration <= found.period / 2:
        return found
    onset, duration = found.onset + found.duration, found.period - found.duration
    x = respond((by * is_on(time, found.period, onset, duration))[:, None])[:, 0]
    product, squares = float(x @ innovations), max(float(x @ x), 1e-300)
    pause = Cycle(found.period, onset, duration, product / squares, product**2 / squares)
    return pause if pause.explained >= AS_MUCH * found.explained else found


def refined_period(
    respond: Respond, innovations: FloatArray, by: FloatArray, time: FloatArray, dt: float, period: float
) -> float:
    """The period near one that is known to less than half a period over the record, by the folding that explains most.

    Parameters are those of `best_cycle`.
    """
    span = float(time[-1] - time[0]) + dt
    for width in (1.0, 0.25):
        tried = [period + width * away * period**2 / span for away in AWAY]
        found = [_folded(respond, innovations, by, time, dt, p) for p in tried]
        period = max(zip(found, tried, strict=True), key=lambda f: f[0][2] if f[0] is not None else -1.0)[1]
    return period


def _parts(dt: float, period: float) -> int:
    return min(PARTS, int(period / dt))


def _folded(
    respond: Respond, innovations: FloatArray, by: FloatArray, time: FloatArray, dt: float, period: float
) -> tuple[float, float, float] | None:
    """Onset and duration [s] of the best window of whole parts of the period, and the squares that it explains."""
    parts = _parts(dt, period)
    part = np.minimum((np.mod(time, period) / period * parts).astype(int), parts - 1)
    X = respond(by[:, None] * (part[:, None] == np.arange(parts)))
    if parts < 2 or not np.isfinite(X).all():
        return None
    begin, long, explained = _best_window(X.T @ X, X.T @ innovations)
    return begin * period / parts, long * period / parts, explained


def _best_window(G: FloatArray, c: FloatArray) -> tuple[int, int, float]:
    """First part and number of parts of the window that explains most, from the products of the responses in parts."""
    n = len(c)
    along = np.concatenate([[0.0], np.cumsum(np.tile(c, 2))])
    over = np.zeros((2 * n + 1, 2 * n + 1))
    over[1:, 1:] = np.cumsum(np.cumsum(np.tile(G, (2, 2)), axis=0), axis=1)
    a, long = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(1, n), indexing="ij"))
    b = a + long
    squares = over[b, b] - over[a, b] - over[b, a] + over[a, a]
    found = np.where(squares > 1e-9 * np.trace(G), (along[b] - along[a]) ** 2 / np.maximum(squares, 1e-300), 0.0)
    best = int(np.argmax(found))
    return int(a[best]), int(long[best]), float(found[best])
