"""What a background leaves unknown on rows that did not fit it, and how likely these rows are beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray

CLIPPED_TURNS = 3
BY_CHANCE = 0.05
"""Share of records in which one of the outputs may err beyond its limit, though nothing is wrong."""


def drop_beside_background(problem: Problem, before: Fit, after: Fit, split: str, own: Problem | None = None) -> float:
    """By how much minus two log-likelihood of the rows of a split falls, with the background as it is before any fit.

    Parameters, effects and noise are those of each fit. Its background is not: on these rows u ~ N(0, I) again. With
    the whitened residual e of the run without it, and the whitened responses H, minus two log-likelihood is::

        e'e - e'H (I + H'H)^-1 H'e + log det(I + H'H) + 2 sum of log s

    Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (5.8); values beyond the clip count as
    the clip. Zero without a background. `own` is the problem of the fit after, where its background is another.
    """
    if problem.background is None:
        return 0.0
    return _beside_background(problem, before, split) - _beside_background(own or problem, after, split)


def _beside_background(problem: Problem, fit: Fit, split: str) -> float:
    background, rows = problem.background, problem.rows(split)
    assert background is not None  # asked by the caller
    plain = fit.predicted - background.change(fit.background)
    e = fit.noise.whiten((problem.measured - plain) / problem.weights)[rows]
    H = fit.noise.whiten(background.responses / problem.weights[:, :, None])[rows]
    present = np.isfinite(e) & np.isfinite(H).all(axis=2)
    spread = float(2 * np.sum(np.log(fit.noise.std) * present.sum(axis=0)))
    e, H = e[present], H[present]
    inside: BoolArray = np.ones(len(e), dtype=bool)
    for _ in range(CLIPPED_TURNS):  # what is clipped depends on the background, and the other way round
        A = np.eye(H.shape[1]) + H[inside].T @ H[inside]
        inside = np.asarray(np.abs(e - H @ np.linalg.solve(A, H[inside].T @ e[inside])) < problem.clip)
    A = np.eye(H.shape[1]) + H[inside].T @ H[inside]
    u = np.linalg.solve(A, H[inside].T @ e[inside])
    left = e[inside] - H[inside] @ u
    clipped = float(np.sum(~inside)) * problem.clip**2
    return float(left @ left + u @ u + np.linalg.slogdet(A)[1]) + clipped + spread


def unknown_of_background(
    problem: Problem, fit: Fit, fitted: Sequence[str], split: str
) -> tuple[FloatArray, FloatArray]:
    """What the background of a fit leaves unknown in each output on the rows of a split: its size, and its limit.

    With the whitened responses H of the rows of the `fitted` splits, and those h_k of an output in row k of K::

        v^2 = tr M    with M = 1/K sum over k of h_k' h_k (I + H'H)^-1

    is the expected square of what stays unknown. Rasmussen & Williams (2006), eq. (2.9). A feed takes few independent
    values over these rows, so that the square that shows may be much larger. It has the distribution of a weighted sum
    of chi-squared variables, which is close to v^2 / d times one of d = (tr M)^2 / tr(M^2) degrees of freedom::

        limit^2 = v^2 / d * quantile of chi^2_d at 1 - 0.05/m

    Satterthwaite, *Biometrics Bull.* 2 (1946) 110; one of m outputs is beyond it by chance in 5 % of records at most.

    Returns
    -------
    tuple
        v (m,) and the limit (m,), in the units of the outputs; both zero without a background.
    """
    outputs = len(problem.columns)
    if problem.background is None:
        return np.zeros(outputs), np.zeros(outputs)
    responses, rows = problem.background.responses, problem.rows(*fitted)
    white = fit.noise.whiten(responses / problem.weights[:, :, None])[rows]
    H = white[np.isfinite(white).all(axis=2) & np.isfinite(problem.measured[rows])]
    covariance = np.linalg.inv(np.eye(responses.shape[2]) + H.T @ H)
    shown = responses[problem.rows(split)]
    sizes, limits = np.zeros(outputs), np.zeros(outputs)
    for j in range(outputs):
        M = shown[:, j].T @ shown[:, j] @ covariance / len(shown)
        mean, square = float(np.trace(M)), float(np.sum(M * M.T))
        if mean > 0 and square > 0:
            freedom = mean**2 / square
            sizes[j] = np.sqrt(mean)
            limits[j] = np.sqrt(mean * chi2.ppf(1 - BY_CHANCE / outputs, freedom) / freedom)
    return sizes, limits
