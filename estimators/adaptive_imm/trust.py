"""What the first record's fit says of the model, before the first sample.

Errors that are not white tell that the model does not explain the record. Then the fitted parameters are absorbers, and
the covariance of the fit is too small by the *colour* of the errors (`estimators/shared/colour.py`). The filter then
knows three things: the fit counts for less, nominal values count for more, and only the modes with a discrepancy are
left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray

NOT_WHITE = 2.0
"""Colour from which the errors of a fit are not white: chance gives it once in a hundred."""


@dataclass(frozen=True)
class Trust:
    """How far a model is trusted.

    During the run the covariance of the parameters grows by the root of the inflation. The discrepancy in the filter
    has taken its part; with all of the inflation the regions of three development seeds were ten times too large.

    Attributes
    ----------
    inflation
        Samples that count as one: the largest colour of an output, or 1 where the errors are white.
    doubt
        1 where the model is ruled out, else 0.
    """

    inflation: float
    doubt: float

    @classmethod
    def of(cls, colour: FloatArray | None, *, doubts: bool) -> Trust:
        """From the colour of what the fit left (m,); see `Prior`."""
        known = np.empty(0) if colour is None else colour[np.isfinite(colour)]
        found = float(known.max(initial=1.0))
        return cls(found, float(doubts)) if found > NOT_WHITE else cls(1.0, 0.0)

    def shown(self, covariance: FloatArray) -> FloatArray:
        """Covariance of the parameters (q, q) as an estimate has it, from that of the filter."""
        return float(np.sqrt(self.inflation)) * covariance

    def undone(self, P: FloatArray) -> FloatArray:
        """Covariance of the filter (n, n) from that of an estimate: the other way round than `shown`.

        The first record and the nominal values are in the estimate already, and do not count again.
        """
        return P / float(np.sqrt(self.inflation))

    def start(
        self, z: FloatArray, P: FloatArray, where: slice, nominal: FloatArray, plausible: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Mean (n,) and covariance (n, n) at the start, with the nominal parameters as a second opinion.

        The covariance of the fit counts by the inflation. The nominal coordinates (q,) with the standard deviations
        `plausible` (q,) are taken as a measurement of those at `where`. Where both contradict each other by more than
        they allow, and the errors of the fit are not white, the fit is the one that errs: its covariance grows by the
        ratio (Birge, Physical Review 40 (1932) 207).
        """
        P = self.inflation * P
        away = nominal - z[where]
        expected = P[where, where] + np.diag(plausible**2)
        ratio = float(away @ np.linalg.solve(expected, away)) / len(away)
        P = P * (1 + (1 - 1 / self.inflation) * max(0.0, ratio - 1))
        gain = np.linalg.solve(P[where, where] + np.diag(plausible**2), P[where, :]).T
        corrected = P - gain @ P[where, :]
        return z + gain @ away, (corrected + corrected.T) / 2
