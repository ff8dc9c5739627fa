"""Each signal of a record: how much of it is there, and how it behaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import theilslopes

from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.records.clean import FATES, Cleaned, runs_of_equal, spikes
from adaptive_flot.records.grid import STATUSES, Codes, Rows

LONG_RUN = 30
"""Equal values in a row, where a signal else changes, that count as frozen."""
HOLE = 2.5
"""Usual steps between two values from which there is a hole between them."""
MOST_FOR_DRIFT = 400
"""Rows, spread over the record, from which the drift is taken."""


@dataclass(frozen=True)
class SignalQuality:
    """One quantity of a record.

    Attributes
    ----------
    name, tag, unit
        Quantity, tag, and the quantity's unit.
    is_input
        Whether it is an input of the model.
    available
        Share of the rows that have a value.
    statuses
        Rows by status: measured, held, averaged, missing, bad, constant.
    dropped
        Values of the export that do not count, by reason.
    holes, longest_hole_s
        Times without a good value for more than HOLE usual steps, and the longest [s].
    frozen, longest_frozen_s
        Stretches of LONG_RUN and more equal values where the signal else changes, and the longest [s].
    spikes
        Values far from their neighbours, those that were dropped counted in.
    low, middle, high
        Quantiles 0.05, 0.5 and 0.95, in the unit.
    noise
        Standard deviation from row to row, in the unit; see the function `noise`.
    drift
        Change over the record, in the unit: Theil and Sen's slope times its duration.
    """

    name: str
    tag: str
    unit: str
    is_input: bool
    available: float
    statuses: Mapping[str, int]
    dropped: Mapping[str, int]
    holes: int
    longest_hole_s: float
    frozen: int
    longest_frozen_s: float
    spikes: int
    low: float
    middle: float
    high: float
    noise: float
    drift: float

    @property
    def spread(self) -> float:
        """Distance between the quantiles 0.05 and 0.95."""
        return self.high - self.low

    @property
    def drifts(self) -> bool:
        """Whether the change over the record is most of its spread, and no noise."""
        return abs(self.drift) > max(0.6 * self.spread, 3 * self.noise)


def signal_quality(cleaned: Cleaned, rows: Rows, is_input: bool) -> SignalQuality:
    """Judge one signal by its own values and by its rows."""
    name = cleaned.quantity.name
    values, status = rows.values[name], rows.statuses[name]
    seen = values[np.isfinite(values)]
    low, middle, high = (float(q) for q in np.quantile(seen, (0.05, 0.5, 0.95))) if len(seen) else (np.nan,) * 3
    time, good = cleaned.time[cleaned.good], cleaned.values[cleaned.good]
    steps = np.diff(time) / 1e9
    usual = float(np.median(steps)) if len(steps) else 0.0
    holes = steps[steps > HOLE * usual]
    frozen = _frozen(good, time)
    return SignalQuality(
        name,
        cleaned.keys.tag,
        cleaned.quantity.unit,
        is_input,
        len(seen) / len(values),
        _by_status(status),
        {fate: cleaned.count(fate) for fate in FATES[1:] if cleaned.count(fate)},
        len(holes),
        float(holes.max(initial=0.0)),
        len(frozen),
        max(frozen, default=0.0),
        int(spikes(good).sum()) + cleaned.count("spike"),
        low,
        middle,
        high,
        noise(values),
        _drift(rows.time / 1e9, values),
    )


def _by_status(status: Codes) -> dict[str, int]:
    counts = np.bincount(status, minlength=len(STATUSES))
    return {word: int(n) for word, n in zip(STATUSES, counts, strict=True) if n}


def _frozen(values: FloatArray, time: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[float]:
    """Durations [s] of the frozen stretches."""
    runs = runs_of_equal(values)
    still = sum(b - a for a, b in runs)
    long = [(a, b) for a, b in runs if b - a >= LONG_RUN]
    rest = len(values) - sum(b - a for a, b in long)
    if not long or still - sum(b - a for a, b in long) > 0.5 * rest or rest < 0.1 * len(values):
        return []  # held or constant, and no sensor that stopped
    return [float(time[b - 1] - time[a]) / 1e9 for a, b in long]


def noise(values: FloatArray) -> float:
    """Standard deviation of white noise in a signal (N,) that else moves slowly, from its differences, robustly.

    ::

        s = median(|y[k] - y[k-1]|) / (0.6745 sqrt(2))

    von Neumann, *Ann. Math. Statist.* 12 (1941) 367, with the median for the mean.
    """
    steps = np.abs(np.diff(values))
    steps = steps[np.isfinite(steps)]
    return float(np.median(steps)) / (0.6745 * np.sqrt(2)) if len(steps) else float("nan")


def _drift(time: FloatArray, values: FloatArray) -> float:
    """Theil and Sen's slope times the duration: the median of the slopes of all pairs of rows.

    Sen, *J. Am. Statist. Assoc.* 63 (1968) 1379.
    """
    seen = np.flatnonzero(np.isfinite(values))
    if len(seen) < 3:
        return float("nan")
    chosen = seen[np.unique(np.linspace(0, len(seen) - 1, MOST_FOR_DRIFT).round().astype(int))]
    slope = float(theilslopes(values[chosen], time[chosen]).slope)
    return slope * float(time[seen[-1]] - time[seen[0]])
