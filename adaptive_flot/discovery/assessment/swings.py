"""Whether an error swings with a period: a first hint where nothing has a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

FEWEST_PERIODS, FEWEST_ROWS = 5, 8
"""Periods in a record, and rows in a period: slower is what wanders, and faster may be noise."""
LEAST_SHARE = 0.5
"""Share of the squared error from which it swings."""
OF_AN_INPUT = 0.3
"""Share of an input within the lines about that frequency from which the input makes it swing."""


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
    n, known = len(error), np.isfinite(error)
    lines = np.arange(FEWEST_PERIODS, n // FEWEST_ROWS)
    if not lines.size or known.sum() < FEWEST_ROWS or not np.nanstd(error) > 0:
        return None
    k = int(lines[np.argmax(_power(error)[lines])])
    time = dt * np.arange(n)

    def wave(frequency: float) -> tuple[float, float]:
        """Share of the squared error, and amplitude."""
        angle = 2 * np.pi * frequency * time[known]
        design = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
        fitted, *_ = np.linalg.lstsq(design, error[known], rcond=None)
        left = float(np.var(error[known] - design @ fitted))
        return 1 - left / float(np.var(error[known])), float(np.hypot(fitted[1], fitted[2]))

    ends = ((k - 1) / (n * dt), (k + 1) / (n * dt))
    best = float(minimize_scalar(lambda f: -wave(f)[0], bounds=ends, method="bounded").x)
    share, amplitude = wave(best)
    by_inputs = (float(_power(u)[k - 1 : k + 2].sum() / _power(u).sum()) for u in inputs.T if np.ptp(u) > 0)
    if share < LEAST_SHARE or any(of_it >= OF_AN_INPUT for of_it in by_inputs):
        return None
    return Swing(1 / best, amplitude, share)


def _power(values: FloatArray) -> FloatArray:
    """Squared transform of values less their mean (N // 2 + 1,), nothing at the line of the mean."""
    level = np.nan_to_num(values - np.nanmean(values)) if np.isfinite(values).any() else np.zeros(len(values))
    power: FloatArray = np.abs(np.fft.rfft(level)) ** 2
    power[0] = 0.0
    return power


def swing_words(name: str, swing: Swing, unit: str) -> str:
    """``the error of pressure swings by 20 kPa every 260 s, which is 80 % of its square``."""
    size = f"{swing.amplitude:.2g} {unit}".removesuffix(" -").strip()
    return (
        f"the error of {name.replace('_', ' ')} swings by {size} up and down every {swing.period:.3g} s, which is "
        f"{100 * swing.share:.0f} % of its square: look for what comes and goes so often"
    )


def swing_notes(model: Model, record: Dataset, columns: Sequence[int], errors: FloatArray) -> tuple[str, ...]:
    """A note on each output `columns` (m,) of a record whose error (N, m) swings: `swing_words`."""
    swings = ((model.outputs[c], swing_of(e, record.inputs, record.dt)) for c, e in zip(columns, errors.T, strict=True))
    return tuple(swing_words(q.name, swing, q.unit) for q, swing in swings if swing is not None)
