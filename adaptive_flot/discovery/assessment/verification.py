"""Verify on rows to which nothing was fitted: the error must be smaller by more than chance, and nowhere larger."""

from __future__ import annotations

import numpy as np
from statsmodels.stats.diagnostic import acorr_ljungbox

from adaptive_flot.discovery.assessment.beside_background import drop_beside_background, unknown_of_background
from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE, rows_per_effective_sample
from adaptive_flot.discovery.assessment.reduction import reduction, squared_errors
from adaptive_flot.discovery.assessment.telling_rows import largest_by_chance, on_telling_rows, touched_rows
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import OutputChange, Verification
from adaptive_flot.greybox.model import FloatArray

BLOCK_ROWS = 20
"""Least rows of a block of the paired block bootstrap: longer than the noise remembers."""
WORSE = 0.02
"""Share by which no output's error may grow."""
MUCH_WORSE = 0.1
"""Share by which an error is worse whatever its interval: a wide interval does not excuse it."""
AT_NOISE = 1.25
"""An error of so many times the noise is the noise: what it does there contradicts nothing."""
LAGS = 20


def verify(problem: Problem, before: Fit, after: Fit, own: Problem | None = None) -> Verification:
    """Compare two fits of the estimation split on the confirm split, in units of the noise of the better one.

    Confirmed where the 95 % interval of the reduction (see `reduction`) lies above zero and no output is worse: its
    error grew by more than WORSE, and the interval of its own reduction lies below zero. Of m outputs one is worse by
    chance m times as often, so each has an interval of 1 - 0.05 / m (Bonferroni; Dunn, *J. Am. Statist. Assoc.* 56
    (1961) 52).

    Beside a background, the rows may be surely likelier: by LEAST_EVIDENCE for each effective sample, with the
    background as it is before any fit (see `drop_beside_background`). An error that is within what noise and background
    leave unknown (the limit of `unknown_of_background`) is not worse where it grew by less than MUCH_WORSE, or the rows
    are likelier. A background may take up what an effect does, so that both predict alike; then likelier rows confirm
    it. That is reason enough not to say `none`. A name asks more of the report rows.

    Of a pulse, only the rows that it touches are compared (see `telling_rows`). They are few, and noise with a memory
    errs in them alike. So an output is worse there where its error grew by more than MUCH_WORSE, and is larger than
    such noise makes it by chance. Rows beside an edge do not count against a pulse, since they can not know when it
    came. They do count for it: not knowing makes the error larger.

    `own` is the problem of the fit after, where its background is another.
    """
    whole, problem = problem, on_telling_rows(problem, before, after, "confirm", ("estimate",))
    own = own and on_telling_rows(own, before, after, "confirm", ("estimate",))
    rows, block = problem.rows("confirm"), block_rows(problem, before, after)
    if not rows.any():
        return Verification(0.0, (float("-inf"), float("inf")), (), False)
    size = problem.weights * after.noise.stationary_std()
    old, new = squared_errors(problem, before, size, rows), squared_errors(problem, after, size, rows)
    smaller, interval = reduction(np.nansum(old, axis=1), np.nansum(new, axis=1), block)
    unknown = unknown_of_background(own or problem, after, ("estimate",), "confirm")[1] / np.sqrt(
        np.nanmean(size[rows] ** 2, axis=0)
    )
    drop = drop_beside_background(problem, before, after, "confirm", own)
    likelier = drop > LEAST_EVIDENCE * rows_per_effective_sample(problem, before, after)
    worse, outputs, larger = [], len(problem.columns), WORSE if problem is whole else MUCH_WORSE
    by_chance = largest_by_chance(after.noise, int(rows.sum()))
    for j, c in enumerate(problem.columns):
        left = float(np.nanmean(new[:, j]))
        ratio = float(np.sqrt(left / np.maximum(np.nanmean(old[:, j]), 1e-300)))
        little = ratio < 1 + MUCH_WORSE or likelier
        within = unknown[j] > 0 and little and left < AT_NOISE**2 * (1 + unknown[j] ** 2)
        within = within or (problem is not whole and left < by_chance[j] ** 2)
        if ratio > 1 + larger and not within and reduction(old[:, j], new[:, j], block, outputs)[1][1] < 0:
            worse.append(after.model.outputs[c].name)
    if problem is not whole and not interval[0] > 0:
        touched = _where_touched(whole, before, after, size)
        smaller, interval = touched if touched[1][0] > 0 else (smaller, interval)
    confirmed = not worse and bool(interval[0] > 0 or likelier)
    return Verification(smaller, interval, tuple(worse), confirmed, likelihood=drop if likelier else 0.0)


def _where_touched(problem: Problem, before: Fit, after: Fit, size: FloatArray) -> tuple[float, tuple[float, float]]:
    """Reduction on all rows of the confirm split that a pulse touches, those beside an edge as well."""
    rows = problem.rows("confirm") & touched_rows(problem, (before, after), "confirm")
    old, new = (np.nansum(squared_errors(problem, fit, size, rows), axis=1) for fit in (before, after))
    return reduction(old, new, block_rows(problem, before, after))


def changes(
    problem: Problem, before: Fit, after: Fit, split: str, block: int | None = None
) -> tuple[OutputChange, ...]:
    """Free-run error of each measured output on one split of the record, before and after.

    `block` is the length of the bootstrap's blocks, by default that of `block_rows`.
    """
    rows, block = problem.rows(split), block or block_rows(problem, before, after)
    ones = np.ones_like(problem.weights)
    old, new = squared_errors(problem, before, ones, rows), squared_errors(problem, after, ones, rows)
    noise = after.noise.stationary_std()
    errors = []
    for j, c in enumerate(problem.columns):
        q = after.model.outputs[c]
        if not np.isfinite(old[:, j]).any():
            continue
        a, b = (float(np.sqrt(np.nanmean(s[:, j]))) for s in (old, new))
        sigma = float(noise[j] * np.sqrt(np.mean(problem.weights[rows, j] ** 2)))
        errors.append(OutputChange(q.name, q.unit, a, b, sigma, reduction(old[:, j], new[:, j], block)[1]))
    return tuple(errors)


def block_rows(problem: Problem, before: Fit, after: Fit) -> int:
    """Rows of a block: more than BLOCK_ROWS where what both fits lack is slower than the noise.

    Twice the rows of an effective sample (see `rows_per_effective_sample`): neighbouring blocks are then next to
    independent.
    """
    return max(BLOCK_ROWS, round(2 * rows_per_effective_sample(problem, before, after)))


def whiteness(problem: Problem, fit: Fit, *, raw: bool) -> dict[str, float]:
    """Ljung-Box p value of each measured output: of the weighted residual (`raw`) or of the whitened innovations.

    Q = n (n + 2) sum_(k=1..LAGS) rho_k^2 / (n - k), chi-squared with LAGS degrees of freedom: Ljung & Box, *Biometrika*
    65 (1978) 297.
    """
    series = fit.residual(problem) / problem.weights if raw else fit.innovations
    p_values = {}
    for j, c in enumerate(problem.columns):
        e = series[problem.rows(), j]
        e = e[np.isfinite(e)]
        if len(e) > 3 * LAGS:
            p_values[fit.model.outputs[c].name] = float(acorr_ljungbox(e, lags=[LAGS])["lb_pvalue"].iloc[0])
    return p_values
