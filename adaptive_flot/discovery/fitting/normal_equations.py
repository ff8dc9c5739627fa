"""Normal equations of one fit: what is whitened, clipped and regularised, along one run.

With whitened innovations e, derivatives J of the predictions by the unknowns z, and a weak prior N(z0, P)::

    A = J'J + P^-1      b = J'e - P^-1 (z - z0)
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray


class NormalEquations:
    """The linear problem on some rows (N,) of a record, for given unknowns."""

    def __init__(self, problem: Problem, rows: BoolArray, unknowns: Unknowns) -> None:
        self.problem, self.rows, self.unknowns = problem, rows, unknowns
        self._white_background: tuple[Noise, FloatArray] | None = None

    def system(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise
    ) -> tuple[FloatArray, FloatArray]:
        """Normal equations (A, b) of the whitened, clipped, regularised problem."""
        rows, w = self.rows, self.problem.weights
        e = noise.whiten((self.problem.measured - predicted) / w)[rows]
        present = np.isfinite(e)
        inside = present & (np.abs(np.where(present, e, 0)) <= self.problem.clip)
        e = e[inside]
        everywhere = np.zeros(w.shape, dtype=bool)
        everywhere[rows] = inside
        J = noise.whiten(slope / w[:, :, None])[everywhere]
        if self.problem.background is not None:
            J = np.hstack([J, self._whitened_background(noise)[inside.ravel()]])
        prior = 1 / self.unknowns.prior**2
        A = J.T @ J + np.diag(prior)
        b = J.T @ e - prior * (z - self.unknowns.prior_centre)
        return A, b

    def _whitened_background(self, noise: Noise) -> FloatArray:
        """Whitened responses (values of the rows, k) to the background, once for each noise model."""
        if self._white_background is None or self._white_background[0] is not noise:
            assert self.problem.background is not None  # asked by the caller
            responses = self.problem.background.responses / self.problem.weights[:, :, None]
            white = noise.whiten(responses)[self.rows]
            self._white_background = noise, white.reshape(-1, white.shape[2])
        return self._white_background[1]
