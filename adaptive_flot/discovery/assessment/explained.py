"""Whether the inputs of a record explain its outputs at all: if not, no dependence can be told from a disturbance.

Two ways, so that neither a poor model nor a poor regression decides alone: the free run of the fitted model, and a
ridge regression on every input at every time scale (the inputs through first-order filters), both judged on rows that
they were not fitted to. Like the data screening this takes all rows, those of the report too: it says whether there is
anything to search for, and chooses no effect. On fewer rows a slow process passes for unexplained by chance.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray

LEAST_EXPLAINED = 0.15
"""Share of the variance of an output; where neither way reaches it in any output, the inputs explain too little."""
FOLDS = 5
FAST_ROWS = 8
"""Time constant of the filter that splits off the faster part of a signal, in rows."""
RIDGE = 1e-2
"""Ridge per sample, for regressors of unit variance."""


def nothing_explained(problem: Problem, fit: Fit) -> str | None:
    """Why the record can not be judged when no input explains any output; None when one does."""
    names = [fit.model.outputs[c].name for c in problem.columns]
    rows = problem.rows("confirm", "report")
    by_model = _shares(problem.measured[rows], fit.predicted[rows])
    if np.max(by_model) >= LEAST_EXPLAINED:
        return None
    by_regression = regression_shares(problem.record, problem.columns)
    if np.max(by_regression) >= LEAST_EXPLAINED:
        return None
    best = int(np.argmax(by_regression))
    ways = f"the model {_percent(by_model[best])} and a regression on all inputs {_percent(by_regression[best])}"
    return (
        f"the inputs explain too little of every measured output: on rows not fitted, {ways} of the variance of "
        f"{names[best]}; what moves it is not in the record (a disturbance, or feedback through an actuator that was "
        "not recorded)"
    )


def regression_shares(record: Dataset, columns: tuple[int, ...]) -> FloatArray:
    """Share of the variance (m,) that filtered inputs explain, by cross-validation over contiguous blocks.

    1 - mean squared error / variance, each of FOLDS blocks predicted by a ridge regression (Hoerl & Kennard,
    *Technometrics* 12 (1970) 55) on the others::

        b = (X'X + RIDGE n I)^-1 X'(y - mean of y)

    The larger of two: of the output itself, and of its faster part, in which a slow process that wanders far shows what
    moves it.
    """
    X, Y = _filtered(record), record.outputs[:, columns]
    explained: FloatArray = np.maximum(_validated(X, Y), _validated(_fast(X), _fast(Y)))
    return explained


def _validated(X: FloatArray, Y: FloatArray) -> FloatArray:
    edges = np.linspace(0, len(X), FOLDS + 1).round().astype(int)
    predicted = np.full(Y.shape, np.nan)
    for j, y in enumerate(Y.T):
        for start, stop in pairwise(edges):
            fitted = np.isfinite(y)
            fitted[start:stop] = False
            if fitted.sum() > 2 * X.shape[1]:
                predicted[start:stop, j] = _ridge(X[fitted], y[fitted], X[start:stop])
    return _shares(Y, predicted)


def _fast(series: FloatArray) -> FloatArray:
    """What changes within FAST_ROWS (N, r); NaN stays, and is bridged for what follows."""
    faster = np.full(series.shape, np.nan)
    keep = np.exp(-1 / FAST_ROWS)
    for j, s in enumerate(series.T):
        ok = np.flatnonzero(np.isfinite(s))
        if ok.size:
            whole = np.interp(np.arange(len(s)), ok, s[ok])
            slow = lfilter([1 - keep], [1, -keep], whole - whole[0])
            faster[ok, j] = (whole - whole[0] - slow)[ok]
    return faster


def _filtered(record: Dataset) -> FloatArray:
    """Every input that moves as it is and through lags of 2, 8, 32 ... rows, standardised (N, r)."""
    regressors = []
    lags = [0.0, *(2.0 * 4**k for k in range(12) if 2.0 * 4**k < len(record) / 8)]
    for u in record.inputs.T:
        if np.std(u) == 0:
            continue
        for lag in lags:
            keep = np.exp(-1 / lag) if lag else 0.0
            regressors.append(lfilter([1 - keep], [1, -keep], u - u[0]))
    X = np.column_stack(regressors) if regressors else np.zeros((len(record), 1))
    standard: FloatArray = (X - X.mean(axis=0)) / np.maximum(X.std(axis=0), 1e-300)
    return standard


def _ridge(X: FloatArray, y: FloatArray, there: FloatArray) -> FloatArray:
    middle = float(np.mean(y))
    A = X.T @ X + RIDGE * len(y) * np.eye(X.shape[1])
    predicted: FloatArray = middle + there @ np.linalg.solve(A, X.T @ (y - middle))
    return predicted


def _shares(measured: FloatArray, predicted: FloatArray) -> FloatArray:
    """1 - mean squared error over variance (m,), minus infinity where nothing can be compared."""
    shares = []
    for y, p in zip(measured.T, predicted.T, strict=True):
        ok = np.isfinite(y) & np.isfinite(p)
        variance = float(np.var(y[ok])) if ok.sum() > 1 else 0.0
        shares.append(1 - float(np.mean((y[ok] - p[ok]) ** 2)) / variance if variance > 0 else -np.inf)
    return np.array(shares)


def _percent(share: float) -> str:
    return "nothing" if share <= 0 else f"{100 * share:.0f} %"
