"""What one step of the adaptive multiple-model filter hands to the next."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.noise import NoiseLevel
from estimators.adaptive_imm.trust import Trust


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
    trust: Trust
    wrong: float
