"""Whether an error swings with a period: a first hint where nothing has a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from adaptive_flot.discovery.results.words import in_seconds
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.quantities import Quantity

FEWEST_PERIODS, FEWEST_ROWS = 5, 8
"""Periods in a record, and rows in a period: slower is what wanders, and faster may be noise."""
LEAST_SHARE = 0.5
"""Share of the squared error from which it swings."""
SAME_PERIOD = 0.05
"""Difference of two periods, as a share, that is none."""
OF_AN_INPUT = 0.3
"""The same of an input at that frequency: then the input makes it swing."""


@dataclass(frozen=True)
class Swing:
    """An error that swings: its period [s], its amplitude, and its share of the squared error."""

    period: float
    amplitude: float
    share: float


def swing_of(error: FloatArray, inputs: FloatArray, dt: float) -> Swing | None:
    """The swing of an error (N,), NaN where nothing was measured; None where it has none, or inputs (N, nu) swing so.

    The frequency f that explains most of the error e by a wave, first among lines of the discrete Fourier transform and
    then between both beside the best, and the share of the squared error that it explains (the periodogram of
    Lomb, *Astrophys. Space Sci.* 39 (1976) 447)::

        e_k = c + a cos(2 pi f t_k) + b sin(2 pi f t_k) + r_k        share = 1 - sum r_k^2 / sum (e_k - mean e)^2
    """
    n = len(error)
    lines = np.arange(FEWEST_PERIODS, n // FEWEST_ROWS)
    if not lines.size or np.isfinite(error).sum() < FEWEST_ROWS or not np.nanstd(error) > 0:
        return None
    time = dt * np.arange(n, dtype=np.float64)
    k = int(lines[np.argmax(_power(error)[lines])])
    ends = ((k - 1) / (n * dt), (k + 1) / (n * dt))
    best = float(minimize_scalar(lambda f: -_wave(error, time, f)[0], bounds=ends, method="bounded").x)
    share, amplitude = _wave(error, time, best)
    if share < LEAST_SHARE or any(_wave(u, time, best)[0] >= OF_AN_INPUT for u in inputs.T if np.ptp(u) > 0):
        return None
    return Swing(1 / best, amplitude, share)


def _wave(values: FloatArray, time: FloatArray, frequency: float) -> tuple[float, float]:
    """Share of the squared values (N,) about their mean that a wave explains, and its amplitude."""
    known = np.isfinite(values)
    angle = 2 * np.pi * frequency * time[known]
    design = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
    fitted = np.linalg.lstsq(design, values[known], rcond=None)[0]
    left = float(np.var(values[known] - design @ fitted))
    return 1 - left / float(np.var(values[known])), float(np.hypot(fitted[1], fitted[2]))


def _power(values: FloatArray) -> FloatArray:
    """Squared transform of values less their mean (N // 2 + 1,), nothing at the line of the mean."""
    level = np.nan_to_num(values - np.nanmean(values)) if np.isfinite(values).any() else np.zeros(len(values))
    power: FloatArray = np.abs(np.fft.rfft(level)) ** 2
    power[0] = 0.0
    return power


def swing_words(swings: Sequence[tuple[Quantity, Swing]]) -> str:
    """``errors swing up and down every 260 s: pressure by 22 kPa (92 %) of the squared error: look for ...``."""
    one = [
        f"{q.name.replace('_', ' ')} by {s.amplitude:.2g} {q.unit}".removesuffix(" -") + f" ({100 * s.share:.0f} %)"
        for q, s in swings
    ]
    period = max((s for _, s in swings), key=lambda s: s.share).period
    return (
        f"errors swing up and down every {in_seconds(period)} s: {', '.join(one)} of the squared error: look for what "
        "comes and goes so often"
    )


def swing_notes(model: Model, record: Dataset, columns: Sequence[int], errors: FloatArray) -> tuple[str, ...]:
    """A note on the outputs `columns` (m,) of a record whose errors (N, m) swing, one for each period."""
    found = ((model.outputs[c], swing_of(e, record.inputs, record.dt)) for c, e in zip(columns, errors.T, strict=True))
    left, notes = [(q, swing) for q, swing in found if swing is not None], list[str]()
    while left:
        period = max((s for _, s in left), key=lambda s: s.share).period
        same = [(q, s) for q, s in left if abs(s.period / period - 1) < SAME_PERIOD]
        left = [each for each in left if each not in same]
        notes.append(swing_words(same))
    return tuple(notes)
