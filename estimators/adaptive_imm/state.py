"""What one step of the adaptive multiple-model filter hands to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.trust import Trust

LAST, MORE_LIKELY = 10.0, 0.5
"""Samples over which the modes with a discrepancy must be the likely ones: outliers beside each other are none."""
LEAST = 0.1
"""Smallest standard deviation, as a share of the first one."""
FIRST = 100.0
"""Samples that the first noise level counts for."""


@dataclass(frozen=True)
class NoiseLevel:
    """Variance of the noise of each output (m,), how many samples it rests on (m,), and the least it may be (m,)."""

    variance: FloatArray
    count: FloatArray
    least: FloatArray

    @classmethod
    def first(cls, std: FloatArray, scale: FloatArray) -> NoiseLevel:
        """From a prior's standard deviations (m,)."""
        variance = np.maximum(std, 1e-9 * scale) ** 2
        return cls(variance, np.full(len(std), FIRST), LEAST**2 * variance)


@dataclass(frozen=True)
class AdaptiveImmState:
    """What the next step needs, for M modes of n entries z = (x, c, v, b).

    Attributes
    ----------
    time
        Time of z [s].
    z, P
        Mean of each mode (n, M), and lower triangle of its covariance (n (n + 1) / 2, M), in columns.
    probability
        Probability of each mode (M,), and 1 for the reference.
    lagged
        Parameter coordinates at which the model is linearised (q,).
    noise
        Noise of the driving outputs.
    slow
        What the long-run variance of their innovations rests on (m, 4), see `LongRun`.
    region
        Covariance of the parameter coordinates as it was shown last (q, q), but for `trust`.
    trust
        What the first record said of the model.
    wrong
        Probability of the modes with a discrepancy, averaged over the last samples.
    """

    time: float
    z: FloatArray
    P: FloatArray
    probability: FloatArray
    lagged: FloatArray
    noise: NoiseLevel
    slow: FloatArray
    region: FloatArray
    trust: Trust
    wrong: float
