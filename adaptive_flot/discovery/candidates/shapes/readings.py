"""A sensor that is read at even intervals and kept in between: an analyser that serves several streams in turn.

On average it is late by half an interval, and so a dead time comes near. Its steps have times of their own, which no
smooth fit finds. So each interval P and first reading f is tried. With the value v along the run, the response r of the
output to it, its residual e, and weights w::

    S(P, f) = sum over readings k of sum over rows i until the next of w_i (v_i + e_i / r - v(f + k P))^2

is least where the readings are. With running sums of w and w (v + e / r), a reading costs the
same however long it is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.robust import without_spikes
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

HELD = "held"
"""The form of such a sensor."""
SHORTEST, LEAST_READINGS = 4.0, 8
"""Least interval that is tried, in rows: what is shorter is hardly a step. And least readings in a record."""
PHASES = 12
"""First readings that are tried in a long interval; in a shorter one one each row."""
REFINED = 9
"""Intervals, and first readings, that are tried around the best in the end."""


@dataclass(frozen=True)
class _Kept:
    """Running sums of the weights, and of weights times what a sensor shows, and the value that it is to show."""

    value: FloatArray
    weights: FloatArray
    shown: FloatArray

    @classmethod
    def of(cls, value: FloatArray, shown: FloatArray, weights: FloatArray) -> _Kept:
        """For what is shown (N,), with the weights of its squares (N,): zero for rows that do not count."""
        return cls(value, *(np.concatenate([[0.0], np.cumsum(each)]) for each in (weights, weights * shown)))

    def gains(self, interval: float, first: FloatArray) -> FloatArray:
        """By how much the squares are less than the shown ones' own (n,), for first readings (n,), all in rows."""
        count = len(self.value)
        last = int((count - 1) / interval) + 2
        at = first[:, None] + interval * np.arange(-1, last)
        read = np.interp(at, np.arange(count), self.value)
        edges = np.clip(np.ceil(at), 0, count).astype(np.intp)
        edges[:, 0], edges[:, -1] = 0, count
        weights, shown = (np.diff(each[edges], axis=1) for each in (self.weights, self.shown))
        gains: FloatArray = np.sum(read[:, :-1] * (2 * shown - read[:, :-1] * weights), axis=1)
        return gains


def readings(value: FloatArray, shown: FloatArray, weights: FloatArray) -> tuple[float, float] | None:
    """Interval and first reading, both in rows, that explain best what is shown; None in a record that is too short.

    Parameters
    ----------
    value
        The value that is read (N,).
    shown
        What the sensor shows (N,).
    weights
        Weights of the squares (N,); zero for rows that do not count.
    """
    count, kept = len(shown), _Kept.of(value, shown, weights)
    longest = count / LEAST_READINGS
    best, interval = (-np.inf, SHORTEST, 0.0), SHORTEST
    while interval <= longest:
        fine = max(1.0, interval / PHASES)
        first = np.arange(0.0, interval, fine)
        gains = kept.gains(interval, first)
        best = max(best, (float(gains.max()), interval, float(first[np.argmax(gains)])))
        interval += fine * interval / count  # by so much the last reading moves by one step of the first one
    if not np.isfinite(best[0]):
        return None
    _, interval, first_reading = best
    fine = max(1.0, interval / PHASES)
    for _ in range(3):
        near = np.linspace(-fine, fine, REFINED)
        intervals, firsts = interval + near * interval / count, first_reading + near
        gains = np.array([kept.gains(each, firsts) for each in intervals.tolist()])
        i, k = np.unravel_index(int(np.argmax(gains)), gains.shape)
        interval, first_reading = float(intervals[i]), float(firsts[k])
        fine /= 3
    return interval, first_reading


def held_score(responses: Responses, plain: Fit, score: Score) -> Score | None:
    """The score of a sensor that is late as one that is read at even intervals; None where no output shows it.

    Parameters
    ----------
    responses
        Responses along a run whose sensor is not late.
    plain
        The fit with the predictions of that run.
    score
        The score of a dead time at the sensor.
    """
    problem, site = responses.problem, score.candidate.site.name
    value = responses.site_values[site]
    output = responses.output_of(site)
    if output is None:
        return None
    j, own = output
    residual = without_spikes(plain.residual(problem) / problem.weights)[:, j]
    counted = np.isfinite(residual) & problem.rows("estimate")
    shown = value + np.nan_to_num(residual) * problem.weights[:, j] / own
    found = readings(value, shown, np.where(counted, (own / problem.weights[:, j]) ** 2, 0.0))
    if found is None:
        return None
    interval, first = found
    periods = float(int((len(value) - 1 - first) / interval))
    dt = problem.record.dt
    begun = float(problem.record.time[0] + first * dt)
    start = {"first_reading": begun, "last_reading": begun + periods * interval * dt}
    settings = {"scale": responses.usual(site) or 1.0, "periods": periods, "interval_s": dt}
    variant = Variant(Effect(site, "delay", HELD, settings=settings), (), ("amplitude",), tuple(start.items()))
    return replace(score, variant=variant, start={"amplitude": 1.0, **start})
