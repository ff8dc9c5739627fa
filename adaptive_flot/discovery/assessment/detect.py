"""Detect: whether the residual of the model as it is is more than noise, in which outputs, and since when.

Tests of the residual (Ljung, *System Identification*, 2nd ed., 16.6): that it is white, that it does not depend on past
inputs (positive lags only, so feedback is no reason), that its size is that of the noise; and a change point. They say
*that* something is missing, hardly ever what: they decide nothing in the search, and are reported.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, norm
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.stats.multitest import multipletests

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.noise import correlation_times, without_spikes
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Detection, Symptom
from adaptive_flot.greybox.model import FloatArray

LEVEL = 0.05
LAGS = 20
"""Lags of the test of whiteness."""
INPUT_LAGS = (1, 2, 4, 8, 16, 32, 64)
"""Rows by which an input may be ahead of the residual it explains."""
WINDOWS = 12
"""Windows of the record between which a jump is looked for."""
FEWEST = 200
"""Rows that a test asks for."""


def detect(problem: Problem, base: Fit) -> Detection:
    """Test the residual of the model as it is, output by output."""
    names = [q.name for q in base.model.inputs]
    residual = without_spikes(base.residual(problem) / problem.weights)
    residual[~problem.rows()] = np.nan
    found: list[tuple[str, float, float, dict[str, float], tuple[float, float | None]]] = []
    for j, c in enumerate(problem.columns):
        r = residual[:, j]
        white = base.noise.whiten(residual)[:, j]
        independent = {n: independence(white, problem.record.inputs[:, i]) for i, n in enumerate(names)}
        found.append((base.model.outputs[c].name, _size(r), _white(r), independent, _change(r, problem.record.time)))
    ps = [p for _, _, white, inputs, (change, _) in found for p in (white, *inputs.values(), change)]
    rejected = iter(_holm(ps))
    symptoms = []
    for name, size, white_p, inputs, (_, onset) in found:
        whole = next(rejected)
        follows = tuple(n for n, rejects in [(n, next(rejected)) for n in inputs] if rejects)
        changed = next(rejected)
        shows = whole or bool(follows) or changed
        symptoms.append(Symptom(name, size, white_p, inputs, follows, onset if changed else None, shows))
    return Detection(tuple(symptoms))


def _holm(ps: list[float]) -> list[bool]:
    """Which of the tests reject at LEVEL together; one that could not be made does not."""
    usable = [p if np.isfinite(p) else 1.0 for p in ps]
    return [bool(r) for r in multipletests(usable, alpha=LEVEL, method="holm")[0]] if usable else []


def _size(r: FloatArray) -> float:
    """Root mean square over the standard deviation by differencing."""
    noise = 1.4826 * float(np.nanmedian(np.abs(np.diff(r)))) / np.sqrt(2) if np.isfinite(np.diff(r)).any() else 0.0
    return float(np.sqrt(np.nanmean(r**2)) / noise) if noise > 0 else float("nan")


def _white(r: FloatArray) -> float:
    e = r[np.isfinite(r)]
    return float(acorr_ljungbox(e, lags=[LAGS])["lb_pvalue"].iloc[0]) if len(e) >= FEWEST else float("nan")


def independence(e: FloatArray, u: FloatArray) -> float:
    """Lagrange multiplier test of a regression on the past of an input: rows x R^2 is chi-squared."""
    most = max(INPUT_LAGS)
    past = np.column_stack([u[most - lag : len(u) - lag] for lag in INPUT_LAGS])
    now = e[most:]
    present = np.isfinite(now)
    count = int(present.sum())
    if count < FEWEST:
        return float("nan")
    X = past[present] - past[present].mean(axis=0)
    y = now[present] - now[present].mean()
    beta, _, rank, _ = np.linalg.lstsq(X, y, rcond=1e-8)
    if rank == 0 or not y @ y > 0:
        return float("nan")
    return float(chi2.sf(count * (1 - np.sum((y - X @ beta) ** 2) / (y @ y)), rank))


def _change(r: FloatArray, time: FloatArray) -> tuple[float, float | None]:
    """P value of no jump, and the time at which the mean after differs most from the mean before (moving sums).

    Windows of a twelfth of the record: a fit bends its parameters until a jump is a saw tooth, whose cumulative sum
    goes nowhere. The spread is the long-run one of what is faster than a window; Bonferroni over the windows.
    """
    present = np.flatnonzero(np.isfinite(r))
    if len(present) < FEWEST:
        return float("nan"), None
    e = r[present]
    window = len(e) // WINDOWS
    sums = np.concatenate([[0.0], np.cumsum(e)])
    means = (sums[window:] - sums[:-window]) / window  # of rows k to k + window - 1
    jump = np.abs(means[window:] - means[:-window])
    fast = e - uniform_filter1d(e, window, mode="nearest")
    spread = float(np.std(fast) * np.sqrt(2 * correlation_times(fast[:, None])[0] / window))
    if not spread > 0:
        return float("nan"), None
    at = int(np.argmax(jump))
    return min(1.0, 2 * WINDOWS * float(norm.sf(jump[at] / spread))), float(time[present[at + window]])
