"""Slopes of model errors by inputs: a linear regression that forgets, and says little before it has seen much.

An error e of an output changes by de while the inputs change by du. With x = (du, 1) and weights that fall with age,

    m = (A / s2 + D)^-1 b / s2,    A = sum w x x',    b = sum w x e,

where D holds the inverse variances that are expected of the slopes beforehand. The variance s2 is that of what the
regression leaves, together with a first guess that counts as one pair. The last of m is a drift, which is no slope.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray

FIRST_STD = 0.01
"""First guess of the standard deviation of what a slope does not explain, in the scale of the output."""
TURNS = 3
"""Slopes and variance are found in turns; the third changes little."""


@dataclass(frozen=True)
class SlopeSums:
    """What is known of the slopes of ny errors by m inputs, all scaled.

    Attributes
    ----------
    squares
        A of each output (ny, m + 1, m + 1).
    products
        b of each output (ny, m + 1).
    errors
        Weighted sum of the squared errors (ny,).
    weight
        Sum of the weights (ny,).
    """

    squares: FloatArray
    products: FloatArray
    errors: FloatArray
    weight: FloatArray

    @classmethod
    def none(cls, outputs: int, inputs: int) -> SlopeSums:
        """Nothing is known yet."""
        size = inputs + 1
        return cls(np.zeros((outputs, size, size)), np.zeros((outputs, size)), np.zeros(outputs), np.zeros(outputs))

    def after(self, change: FloatArray, error: FloatArray, weight: float, memory: float) -> SlopeSums:
        """One pair later.

        Parameters
        ----------
        change, error
            Changes of the inputs (m,) and of the errors (ny,), scaled; NaN where an output was not measured.
        weight
            Of this pair.
        memory
            Factor of what was known before, from 0 to 1.
        """
        if not np.isfinite(change).all():
            return self
        x, seen = np.append(change, 1.0), np.isfinite(error)
        e, w = np.where(seen, error, 0.0), weight * seen
        keep = np.where(seen, memory, 1.0)
        return SlopeSums(
            keep[:, None, None] * self.squares + w[:, None, None] * np.outer(x, x),
            keep[:, None] * self.products + (w * e)[:, None] * x,
            keep * self.errors + w * e**2,
            keep * self.weight + w,
        )

    def slopes(self, prior_std: FloatArray) -> FloatArray:
        """Slopes (ny, m), scaled: those of the highest posterior probability.

        Parameters
        ----------
        prior_std
            Standard deviation that is expected of each before anything is known (ny, m).
        """
        expected = np.column_stack([prior_std, np.ones(len(prior_std))]) ** -2.0
        found = np.zeros_like(self.products)
        for i, (a, b) in enumerate(zip(self.squares, self.products, strict=True)):
            variance = FIRST_STD**2
            for _ in range(TURNS):
                m = np.linalg.solve(a / variance + np.diag(expected[i]), b / variance)
                left = max(float(self.errors[i] - 2 * b @ m + m @ a @ m), 0.0)
                variance = (left + FIRST_STD**2) / (self.weight[i] + 1)
            found[i] = m
        return found[:, :-1]
