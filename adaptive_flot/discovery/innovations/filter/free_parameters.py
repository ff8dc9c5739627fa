"""The free parameters of a fit: their ranges and scales, what is known of them before, and steps that stay in range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.greybox.model import FloatArray, Model

LOOSE = 30.0
"""Standard deviation of the prior of a free parameter about its start, in its scales."""


class FreeParameters:
    """Some parameters of a model, which a fit moves.

    Parameters
    ----------
    model
        The model.
    names
        Names of the free parameters.
    known
        What is known of some of them before.

    Attributes
    ----------
    where
        Their indices among the parameters of the model.
    scale, lower, upper
        Their scales and ranges (q,).
    """

    def __init__(self, model: Model, names: Sequence[str], known: Constants | None) -> None:
        self.where = list(model.indices("parameters", names))
        chosen = [model.parameters[i] for i in self.where]
        self.scale = np.array([q.scale or abs(q.value) or 1.0 for q in chosen])
        self.lower, self.upper = (np.array([getattr(q, end) for q in chosen]) for end in ("lower", "upper"))
        self.known = known
        self._constants = [list(names).index(n) for n in known.names] if known is not None else []
        self._root = np.linalg.inv(known.root) if known is not None else np.empty((0, 0))

    def inside(self, p: FloatArray) -> FloatArray:
        """Parameters (..., np), the free ones each within its range."""
        inside = p.copy()
        inside[..., self.where] = np.clip(p[..., self.where], self.lower, self.upper)
        return inside

    def prior(self, x: FloatArray, first: FloatArray) -> FloatArray:
        """Distances from what is known before, in standard deviations (q + c,)."""
        loose = (x - first) / (self.scale * LOOSE)
        if self.known is None:
            return loose
        told: FloatArray = self._root @ self.known.distances(x[self._constants])
        return np.concatenate([loose, told])

    def known_rows(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What is known before of the constants as further rows of a regression on innovations, at parameters (np,).

        With the covariance S of what is known, the distances d(p) from its mean (see `Constants`), and L L' = S::

            0 = L^-1 d(p) + L^-1 d'(p) dp

        Returns
        -------
        tuple
            L^-1 d' by the free parameters (c, q), and -L^-1 d (c,); no rows where nothing is known.
        """
        rows = np.zeros((len(self._root), len(self.where)))
        if self.known is None:
            return rows, np.empty(0)
        now = p[self.where][self._constants]
        rows[:, self._constants] = self._root * self.known.slopes(now)
        return rows, -self._root @ self.known.distances(now)

    def stepped(self, p: FloatArray, step: FloatArray, shares: Sequence[float]) -> list[FloatArray]:
        """Parameters (np,) after shares of a step of the free ones (q,), each in its range."""
        tried = [p.copy() for _ in shares]
        for q, share in zip(tried, shares, strict=True):
            q[self.where] = np.clip(p[self.where] + share * step, self.lower, self.upper)
        return tried

    def step(self, p: FloatArray, A: FloatArray, b: FloatArray) -> FloatArray:
        """One step of Gauss and Newton by normal equations in scales; an unknown that would leave its range is held."""
        x = p[self.where]
        held = np.zeros(len(x), dtype=bool)
        if not (np.isfinite(A).all() and np.isfinite(b).all()):
            return held.astype(float)
        while True:
            move = np.zeros(len(x))
            free = ~held
            move[free] = np.linalg.lstsq(A[np.ix_(free, free)], b[free], rcond=1e-12)[0]
            out = x + move * self.scale
            beyond = free & (((out < self.lower) & (x <= self.lower)) | ((out > self.upper) & (x >= self.upper)))
            if not beyond.any():
                moved: FloatArray = move * self.scale
                return moved
            held |= beyond
