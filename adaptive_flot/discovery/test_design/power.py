"""How often a test would tell the right alternative: it is simulated with each of them as the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.test_design.separation import Prediction
from adaptive_flot.greybox.model import FloatArray

DRAWS = 200
"""Simulated outcomes of a test for each truth: a share of 0.8 is known to 0.03."""


def power(runs: Sequence[Prediction], needed: float) -> tuple[float, ...]:
    """Share of simulated tests in which the true one of several alternatives is told from all others.

    With alternative a as the truth, outcomes are drawn with its uncertain parameters and white noise, and every
    alternative b is judged by minus two log-likelihood, its own uncertain parameters fitted again::

        y = y_a + X_a g + e,   g, e ~ N(0, I)
        L_b = (y - y_b)' (I + X_b X_b')^-1 (y - y_b)

    a is told where L_b - L_a is at least `needed` for all others. Everything is whitened. A parametric
    simulation of the power: Davison & Hinkley, *Bootstrap Methods and their Application* (1997), 4.2.

    Parameters
    ----------
    runs
        Predictions of one test by each alternative.
    needed
        Difference in minus two log-likelihood from which two count as told apart.
    """
    factors = [np.linalg.svd(run.uncertain, full_matrices=False)[:2] for run in runs]
    shares = []
    for a, truth in enumerate(runs):
        rng = np.random.default_rng(a)
        moved = truth.uncertain @ rng.standard_normal((truth.uncertain.shape[1], DRAWS))
        drawn = truth.white[:, None] + moved + rng.standard_normal((len(truth.white), DRAWS))
        criteria = np.array([_criterion(drawn, run, *f) for run, f in zip(runs, factors, strict=True)])
        others = np.delete(criteria, a, axis=0)
        shares.append(float(np.mean(np.min(others, axis=0) - criteria[a] >= needed)))
    return tuple(shares)


def _criterion(drawn: FloatArray, run: Prediction, turned: FloatArray, size: FloatArray) -> FloatArray:
    """Minus two log-likelihood (draws,) of outcomes (N, draws), from the singular vectors and values of X."""
    r = drawn - run.white[:, None]
    hidden = np.sum((turned.T @ r) ** 2 * (size**2 / (1 + size**2))[:, None], axis=0)
    criterion: FloatArray = np.sum(r**2, axis=0) - hidden
    return criterion
