"""What a background leaves unknown on rows that did not fit it, and how likely these rows are beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.model import FloatArray

CLIPPED_TURNS = 3


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


def unknown_of_background(problem: Problem, fit: Fit, fitted: Sequence[str], split: str) -> FloatArray:
    """Standard deviation (m,) of what the background of a fit leaves unknown in each output on the rows of a split.

    With the whitened responses H of the rows of the `fitted` splits, and those h_k of an output in row k::

        v^2 = mean over k of h_k (I + H'H)^-1 h_k'

    Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (2.9). Zero without a background.
    """
    if problem.background is None:
        return np.zeros(len(problem.columns))
    responses, rows = problem.background.responses, problem.rows(*fitted)
    white = fit.noise.whiten(responses / problem.weights[:, :, None])[rows]
    H = white[np.isfinite(white).all(axis=2) & np.isfinite(problem.measured[rows])]
    covariance = np.linalg.inv(np.eye(responses.shape[2]) + H.T @ H)
    shown = responses[problem.rows(split)]
    return np.asarray(np.sqrt(np.mean(np.einsum("kji,il,kjl->kj", shown, covariance, shown, optimize=True), axis=0)))
