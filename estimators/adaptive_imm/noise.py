"""The noise level of each output, from what the corrected estimate leaves of the measurements."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.bank import Corrected, output_variance

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


def matched(
    variance: ca.MX, count: ca.MX, corrected: Corrected, probability: ca.MX, H: ca.MX, residual: ca.MX, present: ca.MX
) -> ca.MX:
    """Variance of the noise of each output (m,), one sample later: ``r^2 += (e^2 + H P H' - r^2) / count``.

    e and P are those after the correction. The mean over the modes, each value weighed by how far it is believed.
    Source: covariance matching on residuals, Mohamed & Schwarz, Journal of Geodesy 73 (1999) 193, equation 24.
    """
    modes = probability.shape[0]
    left = ca.repmat(residual, 1, modes) - H @ corrected.away
    seen = (left**2 + output_variance(H, corrected.P, modes)) * corrected.believed
    good = corrected.believed @ probability
    return variance + present * (seen @ probability - good * variance) / count
