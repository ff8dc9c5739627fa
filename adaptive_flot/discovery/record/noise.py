"""What the noise of each output looks like: constant or proportional, white or autoregressive, with outliers.

Every alternative gets its own noise model. A noise model that was fitted once to a suspect residual hides slow effects:
it explains the drift as coloured noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from adaptive_flot.discovery.record.robust import CLIP, FEWEST_PAIRS, clipped_std
from adaptive_flot.greybox.model import FloatArray

MOST_LAGS = 3
IMPULSE = np.eye(1, 501)[0]
DIED_AWAY = 1e-12
"""Response to an impulse after 500 rows below which an autoregression is stable, without a look at its poles."""
MEMORY = 2.0
"""Noise is at most this many times as large as its innovations: what is slower and smoother is no measurement noise but
physics that is missing, and a noise model that may be as slow as it likes would explain it away."""


@dataclass(frozen=True)
class Noise:
    """Noise of m outputs.

    Attributes
    ----------
    std
        Standard deviation of the innovations (m,), in units of the weights.
    lags
        Autoregressive coefficients (m, p), zero where an output needs fewer.
    """

    std: FloatArray
    lags: FloatArray

    def whiten(self, series: FloatArray) -> FloatArray:
        """Whitened series over the innovation's standard deviation; series (N, m) or (N, m, q), weighted already.

        A value that is missing takes those with it that look back to it, whether or not this noise does, so that fits
        with different noise models count the same rows; not where an output is too sparse for any but white noise.
        """
        white = series.copy()
        for j, lags in enumerate(self.lags):
            spreads = series.ndim == 2 and is_dense(series[:, j])
            for i, lag in enumerate(lags):
                if lag or spreads:
                    white[i + 1 :, j] -= lag * series[: -(i + 1), j]
            white[:, j] /= self.std[j]
        return white

    def stationary_std(self) -> FloatArray:
        """Standard deviation of the noise itself (m,), from its spectrum.

        With A(w) = 1 - sum_i a_i exp(-j w i)::

            variance = s^2 / (2 pi) integral over [-pi, pi] of |A(w)|^-2 dw

        Box & Jenkins, *Time Series Analysis* (1976), 3.2.
        """
        omega = np.linspace(0, np.pi, 2048)
        deviations = []
        for std, lags in zip(self.std, self.lags, strict=True):
            response = 1 - sum(a * np.exp(-1j * omega * (i + 1)) for i, a in enumerate(lags))
            deviations.append(std * np.sqrt(np.mean(1 / np.abs(response) ** 2)))
        return np.array(deviations)


def with_rows_before(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows (N,) that are true and those before them that whitening looks back to."""
    reached = rows.copy()
    for lag in range(1, MOST_LAGS + 1):
        reached[:-lag] |= rows[lag:]
    return reached


def is_dense(series: FloatArray) -> bool:
    """Whether a series (N,), NaN where missing, has values whose past is measured: enough of them, and most."""
    present = np.isfinite(series)
    after = present[MOST_LAGS:].copy()
    for lag in range(1, MOST_LAGS + 1):
        after &= present[MOST_LAGS - lag : len(present) - lag]
    pairs = int(after.sum())
    return pairs >= FEWEST_PAIRS and pairs > 0.5 * int(present.sum())


def white_noise(residual: FloatArray, rows: NDArray[np.bool_], floor: FloatArray) -> Noise:
    """White noise with the plain standard deviation of a weighted residual (N, m) on some rows (N,)."""
    std = np.array([clipped_std(r[rows], robust=False) for r in residual.T])
    return Noise(np.maximum(std, floor), np.zeros((len(std), MOST_LAGS)))


def fit_noise(residual: FloatArray, rows: NDArray[np.bool_], floor: FloatArray) -> Noise:
    """Noise model of a weighted residual (N, m), fitted on the rows (N,) that are true; NaN where missing.

    r_k = sum_i a_i r_(k-i) + e_k with e ~ N(0, s^2), by conditional least squares. The order p (up to MOST_LAGS) is
    chosen per output by the Bayesian information criterion::

        2 n log s_p + p log n

    Schwarz, *Ann. Statist.* 6 (1978) 461. `floor` (m,) is the smallest standard deviation believed.
    """
    m = residual.shape[1]
    lags, std = np.zeros((m, MOST_LAGS)), np.zeros(m)
    for j in range(m):
        std[j], lags[j] = _one_output(residual[:, j], rows)
    return Noise(np.maximum(std, floor), lags)


def _one_output(r: FloatArray, rows: NDArray[np.bool_]) -> tuple[float, FloatArray]:
    nothing = np.zeros(MOST_LAGS)
    first = clipped_std(r[rows])
    if not first > 0:
        return first, nothing
    limit = CLIP * first
    clipped = np.clip(r, -limit, limit)  # an outlier must not pose as correlation
    past = np.column_stack([np.concatenate([np.full(i + 1, np.nan), clipped[: -(i + 1)]]) for i in range(MOST_LAGS)])
    usable = rows & np.isfinite(r) & np.isfinite(past).all(axis=1)
    count = int(usable.sum())
    if count < FEWEST_PAIRS or not is_dense(r):
        return first, nothing
    best, chosen = np.inf, (first, nothing)
    for order in range(MOST_LAGS + 1):
        a = np.zeros(MOST_LAGS)
        if order:
            a[:order] = np.linalg.lstsq(past[usable, :order], clipped[usable], rcond=None)[0]
            a = _short(a)
        std = clipped_std(r[usable] - past[usable] @ a)
        score = 2 * count * np.log(max(std, 1e-300)) + order * np.log(count)
        if score < best - 1e-9:
            best, chosen = score, (std, a)
    return chosen


def _short(a: FloatArray) -> FloatArray:
    """Pull the poles in until the noise is at most MEMORY times as large as its innovations."""
    low, high = 0.0, 1.0
    if _memory(a) <= MEMORY:
        return a
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if _memory(_pulled(a, middle)) <= MEMORY else (low, middle)
    return _pulled(a, low)


def _pulled(a: FloatArray, factor: float) -> FloatArray:
    pulled: FloatArray = a * factor ** np.arange(1, len(a) + 1)
    return pulled


def _memory(a: FloatArray) -> float:
    """Standard deviation of an autoregression over that of its innovations; infinite when it is not stable.

    sqrt(sum_k h_k^2) with its impulse response h: Box & Jenkins (1976), 3.1.
    """
    response = lfilter([1.0], np.concatenate([[1.0], -a]), IMPULSE)
    last = np.max(np.abs(response[-len(a) :]))
    if not last < DIED_AWAY and np.max(np.abs(np.roots(np.concatenate([[1.0], -a])))) >= 1:
        return float("inf")
    return float(np.sqrt(np.sum(response**2)))


def proportional(residual: FloatArray, predicted: FloatArray) -> FloatArray:
    """Weights (N, m): size of the prediction over its mean where the noise grows with the value, else 1.

    Judged on differences d of the residual, in which slow model errors cancel, by minus two log-likelihood: with
    w = size / mean, the noise is proportional where::

        2 n log s(d / w) + 2 sum log w < 2 n log s(d) - 10
    """
    weights = np.ones_like(predicted)
    for j in range(predicted.shape[1]):
        d = np.diff(residual[:, j])
        size = np.abs(predicted[1:, j])
        ok = np.isfinite(d) & (size > 0)
        if ok.sum() < FEWEST_PAIRS or np.ptp(size[ok]) < 0.1 * np.mean(size[ok]):
            continue
        w = size / np.mean(size[ok])
        constant = 2 * ok.sum() * np.log(clipped_std(d[ok]))
        scaled = 2 * ok.sum() * np.log(clipped_std(d[ok] / w[ok])) + 2 * np.sum(np.log(w[ok]))
        if scaled < constant - 10:
            weights[:, j] = np.maximum(np.abs(predicted[:, j]) / np.mean(size[ok]), 0.05)
    return weights
