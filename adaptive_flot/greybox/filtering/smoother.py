"""States and walking parameters given the whole record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.filtering.filter import Filtered
from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class Smoothed:
    """Mean (N, n) and covariance (N, n, n) of states and walking parameters given all rows."""

    z: FloatArray
    P: FloatArray

    def std(self) -> FloatArray:
        """Standard deviations (N, n)."""
        std: FloatArray = np.sqrt(np.maximum(np.einsum("kii->ki", self.P), 0.0))
        return std


def smooth(filtered: Filtered) -> Smoothed:
    """Fixed-interval smoother, from the last row to the first.

    ``G_k = P_k F_k' M_k^-1``, ``M_k = F_k (P_k + Q) F_k'``, ``z_k|N = z_k + G_k (z_k+1|N - f(z_k))`` and
    ``P_k|N = P_k + G_k (P_k+1|N - M_k) G_k'``. Rauch, Tung & Striebel, *AIAA Journal* 3 (1965) 1445.
    A direction that the map forgets at once (M_k is singular) is left out by a pseudo-inverse.
    """
    z, P = filtered.z.copy(), filtered.P.copy()
    for k in range(len(z) - 2, -1, -1):
        F = filtered.F[k]
        ahead = F @ (filtered.P[k] + np.diag(filtered.Q)) @ F.T
        size = np.sqrt(np.maximum(np.diag(ahead), 1e-300))
        inverse = np.linalg.pinv(ahead / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(size, size)
        gain = filtered.P[k] @ F.T @ inverse
        z[k] = filtered.z[k] + gain @ (z[k + 1] - filtered.ahead[k])
        smoothed = filtered.P[k] + gain @ (P[k + 1] - ahead) @ gain.T
        P[k] = (smoothed + smoothed.T) / 2
    return Smoothed(z, P)
