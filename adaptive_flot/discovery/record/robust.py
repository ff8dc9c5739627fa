"""Robust statistics of a series: spread without outliers, noise without a model, spikes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import binom

from adaptive_flot.greybox.model import FloatArray

CLIP = 3.0
"""Innovations count up to this many standard deviations (Huber): an outlier does not steer a fit."""
_CLIPPED_VARIANCE = 0.99503
"""E[min(z^2, CLIP^2)] of a standard normal z."""
SPIKE, SPIKE_WINDOW = 6.0, 5
"""A spike is further from the median of so many neighbours than so many standard deviations of such distances."""
ORDERS = range(1, 7)
MOTION = 0.7
"""With a memory of 0.9 in the noise, high orders have 0.73 times the noise of the first; with 0.5, 0.82 times."""
STILL = 0.2
FEWEST_PAIRS = 200
"""Consecutive measured pairs that an autoregressive noise model asks for; a sparse assay has white noise."""


def noise_by_differences(series: FloatArray) -> FloatArray:
    """Standard deviation of the noise of each column (m,) of a series (N, m) that is else smooth: it needs no model.

    ::

        s = 1.4826 median |r_k - r_(k-1)| / sqrt(2)

    From one row to the next, or, of an output that is measured more rarely, from one value to the next. Where most
    differences are zero (a coarse resolution), their root mean square takes the place of the median. NaN of fewer than
    two values. von Neumann, *Ann. Math. Statist.* 12 (1941) 367, with the median absolute deviation of Hampel,
    *J. Am. Statist. Assoc.* 69 (1974) 383.
    """
    deviations = []
    for r in series.T:
        d = np.diff(r)
        d = d[np.isfinite(d)]
        if len(d) < FEWEST_PAIRS:
            d = np.diff(r[np.isfinite(r)])
        if not d.size:
            deviations.append(np.nan)
            continue
        robust = 1.4826 * float(np.median(np.abs(d)))
        deviations.append((robust or float(np.sqrt(np.mean(d**2)))) / np.sqrt(2))
    return np.array(deviations)


def least_by_orders(series: FloatArray, orders: Sequence[int]) -> FloatArray:
    """The least (m,) of the noise of a series (N, m) by differences of some orders; infinite where none is told."""
    each = [noise_by_differences(np.diff(series, n - 1, axis=0)) * np.sqrt(2 / binom(2 * n, n)) for n in orders]
    least: FloatArray = np.min(np.where(np.isfinite(each), each, np.inf), axis=0)
    return least


def noise_beside_motion(series: FloatArray) -> FloatArray:
    """The same (m,) of a series (N, m) that may move much from row to row, as an oscillator does.

    Differences of order n leave out what moves slowly compared to n rows. The least of them counts where it is less
    than MOTION times that of the first: noise with a memory alone brings them closer together::

        s_n = 1.4826 median |D^n y| / sqrt(binomial(2 n, n))        n = 1 ... 6

    Not where more than STILL of the first differences are zero: medians of a coarse resolution are multiples of it, and
    the least of several of them is too small. Gasser, Sroka & Jennen-Steinmetz, *Biometrika* 73 (1986) 625.
    """
    first, least = noise_by_differences(series), least_by_orders(series, ORDERS)
    steps = np.diff(series, axis=0)
    coarse = np.sum(steps == 0, axis=0) > STILL * np.sum(np.isfinite(steps), axis=0)
    found: FloatArray = np.where((least < MOTION * first) & ~coarse, least, first)
    return found


def memory(series: FloatArray) -> FloatArray:
    """Correlation of neighbours in each column (m,) of a series (N, m) about zero; zero of fewer than two such pairs.

    Over the rows k where both are there::

        sum_k e_k e_(k+1) / sqrt(sum_k e_k^2  sum_k e_(k+1)^2)
    """
    found = np.zeros(series.shape[1])
    for j, e in enumerate(series.T):
        both = np.isfinite(e[:-1]) & np.isfinite(e[1:])
        one, other = e[:-1][both], e[1:][both]
        size = np.sqrt(np.sum(one**2) * np.sum(other**2))
        if len(one) > 1 and size > 0:
            found[j] = np.sum(one * other) / size
    return found


AT_NOISE = 1.1
"""Errors of at most so many times the noise from row to row are that noise."""
GOES_ON = 0.5
"""What is measured goes on from row to row where neighbours have such a correlation; so would what a model lacks."""


def without_memory(errors: FloatArray, measured: FloatArray) -> NDArray[np.bool_]:
    """Whether errors (N, m) of what is `measured` (N, m) are noise from row to row, however large single ones are (m,).

    Errors of a correlation r between neighbours are sqrt(1 / (1 - r)) times the noise that their differences show, and
    that is at most AT_NOISE. What is measured must go on from row to row: else what a model lacks has no memory
    either. Outliers, and noise that is larger where the value is, make errors larger than the usual difference between
    rows, and have none.
    """
    with np.errstate(all="ignore"):
        about = measured - np.nanmean(measured, axis=0)
    found: NDArray[np.bool_] = (memory(about) > GOES_ON) & (memory(errors) <= 1 - 1 / AT_NOISE**2)
    return found


def clipped_std(e: FloatArray, *, robust: bool = True) -> float:
    """Return the standard deviation of the finite entries, each counted up to CLIP of it.

    Solved by iteration for s, where z is standard normal::

        mean of min((e / s)^2, CLIP^2) = E[min(z^2, CLIP^2)]

    Huber's proposal 2: *Ann. Math. Statist.* 35 (1964) 73, section 8. Not `robust`: the root mean square.
    """
    z = e[np.isfinite(e)]
    if z.size == 0:
        return float("nan")
    if not robust:
        return float(np.sqrt(np.mean(z**2)))
    std = 1.4826 * float(np.median(np.abs(z))) or float(np.sqrt(np.mean(z**2)))
    for _ in range(30):
        if std <= 0:
            return 0.0
        new = std * float(np.sqrt(np.mean(np.minimum((z / std) ** 2, CLIP**2)) / _CLIPPED_VARIANCE))
        if abs(new - std) < 1e-6 * std:
            return new
        std = new
    return std


def without_spikes(residual: FloatArray) -> FloatArray:
    """A residual (N, m) in which single values far from their neighbours are put in their midst.

    Hampel's filter (Davies & Gather, *J. Am. Statist. Assoc.* 88 (1993) 782): v_k becomes the median m_k of
    SPIKE_WINDOW values around it where::

        |v_k - m_k| > SPIKE 1.4826 median |v - m|

    What a model lacks changes from row to row by less than the noise; a spike in its place would be explained by
    whatever happens to fit it.
    """
    clean = residual.copy()
    for j in range(residual.shape[1]):
        r = residual[:, j]
        present = np.flatnonzero(np.isfinite(r))
        if len(present) < SPIKE_WINDOW:
            continue
        v = r[present]
        middle = median_filter(v, SPIKE_WINDOW, mode="nearest")
        away = np.abs(v - middle)
        limit = SPIKE * 1.4826 * float(np.median(away))
        clean[present, j] = np.where(away > limit, middle, v) if limit > 0 else v
    return clean
