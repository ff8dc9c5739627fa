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

from adaptive_flot.discovery.assessment.holm import holm
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import without_spikes
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

Test = tuple[str, str, str]
"""Output, what is tested, and of which input, if any."""


def detect(problem: Problem, base: Fit) -> Detection:
    """Test the residual of the model as it is, output by output."""
    names = [q.name for q in base.model.inputs]
    residual = without_spikes(base.residual(problem) / problem.weights)
    residual[~problem.rows()] = np.nan
    innovations = base.noise.whiten(residual)
    outputs = [base.model.outputs[c].name for c in problem.columns]
    white = {output: _white(residual[:, j]) for j, output in enumerate(outputs)}
    change = {output: _change(residual[:, j], problem.record.time) for j, output in enumerate(outputs)}
    past = {
        output: {n: independence(innovations[:, j], problem.record.inputs[:, i]) for i, n in enumerate(names)}
        for j, output in enumerate(outputs)
    }
    p_values: dict[Test, float] = {}
    for output in outputs:
        p_values[output, "whiteness", ""] = white[output]
        p_values |= {(output, "past of", n): p for n, p in past[output].items()}
        p_values[output, "change", ""] = change[output][0]
    rejected = holm(p_values, LEVEL)
    symptoms = []
    for j, output in enumerate(outputs):
        follows = tuple(n for n in names if rejected[output, "past of", n])
        changed = rejected[output, "change", ""]
        shows = rejected[output, "whiteness", ""] or bool(follows) or changed
        onset = change[output][1] if changed else None
        symptoms.append(Symptom(output, _size(residual[:, j]), white[output], past[output], follows, onset, shows))
    return Detection(tuple(symptoms))


def _size(r: FloatArray) -> float:
    """Root mean square over the standard deviation by differencing."""
    noise = 1.4826 * float(np.nanmedian(np.abs(np.diff(r)))) / np.sqrt(2) if np.isfinite(np.diff(r)).any() else 0.0
    return float(np.sqrt(np.nanmean(r**2)) / noise) if noise > 0 else float("nan")


def _white(r: FloatArray) -> float:
    """P value of whiteness, with the autocorrelations rho of n values and h = LAGS; missing values are closed up.

    ::

        Q = n (n + 2) sum_(k=1..h) rho_k^2 / (n - k),   chi-squared with h degrees of freedom

    Ljung & Box, *Biometrika* 65 (1978) 297.
    """
    e = r[np.isfinite(r)]
    return float(acorr_ljungbox(e, lags=[LAGS])["lb_pvalue"].iloc[0]) if len(e) >= FEWEST else float("nan")


def independence(e: FloatArray, u: FloatArray) -> float:
    """P value of no regression of innovations e (N,) on the past of an input u (N,), at INPUT_LAGS.

    Lagrange multiplier test: n R^2 is chi-squared with as many degrees of freedom as there are independent lags.
    Engle, *Handbook of Econometrics* II (1984) 775, eq. (13). NaN with too few rows, or an input that does not move.
    """
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

    With the means m_k of the w rows from k on, the standard deviation s of what is faster than a window, and its
    autocorrelation time t::

        z = max_k |m_(k+w) - m_k| / (s sqrt(2 t / w)),   p = min(1, 2 WINDOWS (1 - Phi(z)))

    Bauer & Hackl, *Technometrics* 20 (1978) 431, with Bonferroni's bound over the windows. Windows of a twelfth of the
    record: a fit bends its parameters until a jump is a saw tooth, whose cumulative sum goes nowhere.
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
