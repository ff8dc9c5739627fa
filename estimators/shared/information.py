"""What the data of the last while say about each direction of the parameters, and where that is too little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class Information:
    """Judges an information matrix against a diagonal covariance A of parameters known roughly.

    In units of A the eigenvalue of a direction is how many times more the data say about it than A does. Below 1 an
    estimate along it would follow the noise and errors of the model more than the process.

    Attributes
    ----------
    alternative
        A (q, q), diagonal.
    memory_s
        Time over which information is summed, with exponential weights [s].
    """

    alternative: FloatArray
    memory_s: float

    def start(self, covariance: FloatArray) -> FloatArray:
        """Information (q, q) that a prior covariance stands for; the data it came from count as recent."""
        information: FloatArray = np.linalg.pinv(covariance, hermitian=True).astype(np.float64)
        return information

    def add(self, information: FloatArray, gained: FloatArray, dt: float) -> FloatArray:
        """Information after an interval of dt seconds that brought `gained` (q, q)."""
        return max(0.0, 1.0 - dt / self.memory_s) * information + gained

    def free_directions(self, information: FloatArray) -> tuple[FloatArray, bool]:
        """Projection (q, q) onto the directions that the data speak about, and whether any is left out."""
        scale = np.sqrt(np.diag(self.alternative))
        values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
        free = vectors[:, values >= 1.0]
        projection: FloatArray = (free @ free.T) * scale[:, None] / scale
        return projection, free.shape[1] < len(values)

    def free_directions_of(self, information: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The same for many matrices (M, q, q): projections (M, q, q), and whether any direction is left out (M,)."""
        scale = np.sqrt(np.diag(self.alternative))
        values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
        free = vectors * (values >= 1.0)[:, None, :]
        projection: FloatArray = (free @ free.transpose(0, 2, 1)) * scale[:, None] / scale
        return projection, np.asarray(values.min(axis=1) < 1.0)
