"""Verify on rows to which nothing was fitted: the error must be smaller by more than chance, and nowhere larger."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import bootstrap
from statsmodels.stats.diagnostic import acorr_ljungbox

from adaptive_flot.discovery.fitting.fit import Fit, row_losses
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.discovery.results import OutputChange, Verification
from adaptive_flot.greybox.model import FloatArray

BLOCK_ROWS = 20
"""Least rows of a block of the paired block bootstrap: longer than the noise remembers."""
COMPARISON_BLOCK_ROWS = 60
"""Rows of a block in which two fits are compared: what both lack is slower than the noise."""
SHORTEST_BLOCK = 4
MANY_BLOCKS = 8
"""A split too short for so many blocks gets shorter ones."""
DRAWS = 500
WORSE = 0.02
"""Share by which no output's error may grow."""
MUCH_WORSE = 0.1
"""Share by which an error is worse whatever its interval: a wide interval does not excuse it."""
AT_NOISE = 1.25
"""An error of so many times the noise is the noise: what it does there contradicts nothing."""
LEAST_EVIDENCE = 10.0
"""Drop of a criterion that counts: "very strong" evidence (Kass & Raftery, *J. Am. Statist. Assoc.* 90 (1995) 773)."""
CLIPPED_TURNS = 3
LAGS = 20


def verify(problem: Problem, before: Fit, after: Fit) -> Verification:
    """Compare two fits of the estimation split on the confirm split, in units of the noise of the better one.

    Confirmed where the 95 % interval of the reduction (see `_reduction`) lies above zero and no output is worse: its
    error grew by more than WORSE, and the interval of its own reduction lies below zero. An error that grew by less
    than MUCH_WORSE, and is within what noise and background leave unknown, is not worse (see `unknown_of_background`).

    A background may take up what an effect does, so that both predict alike. Then these rows confirm it where they say
    that the background alone is less likely, by LEAST_EVIDENCE for each effective sample: see
    `drop_beside_background`. That is reason enough not to say `none`. A name asks for a smaller error on report rows.
    """
    rows, block = problem.rows("confirm"), block_rows(problem, before, after)
    size = problem.weights * after.noise.stationary_std()
    old, new = squared_errors(problem, before, size, rows), squared_errors(problem, after, size, rows)
    reduction, interval = _reduction(np.nansum(old, axis=1), np.nansum(new, axis=1), block)
    unknown = unknown_of_background(problem, after, ("estimate",), "confirm") / np.sqrt(
        np.nanmean(size[rows] ** 2, axis=0)
    )
    worse = []
    for j, c in enumerate(problem.columns):
        left = float(np.nanmean(new[:, j]))
        ratio = float(np.sqrt(left / np.maximum(np.nanmean(old[:, j]), 1e-300)))
        within = unknown[j] > 0 and ratio < 1 + MUCH_WORSE and left < AT_NOISE**2 * (1 + unknown[j] ** 2)
        if ratio > 1 + WORSE and not within and _reduction(old[:, j], new[:, j], block)[1][1] < 0:
            worse.append(after.model.outputs[c].name)
    drop = drop_beside_background(problem, before, after, "confirm")
    likelier = drop > LEAST_EVIDENCE * rows_per_effective_sample(problem, before, after)
    confirmed = not worse and bool(interval[0] > 0 or likelier)
    return Verification(reduction, interval, tuple(worse), confirmed, likelihood=drop if likelier else 0.0)


def drop_beside_background(problem: Problem, before: Fit, after: Fit, split: str) -> float:
    """By how much minus two log-likelihood of the rows of a split falls, with the background as it is before any fit.

    Parameters, effects and noise are those of each fit. Its background is not: on these rows u ~ N(0, I) again. With
    the whitened residual e of the run without it, and the whitened responses H, minus two log-likelihood is::

        e'e - e'H (I + H'H)^-1 H'e + log det(I + H'H) + 2 sum of log s

    Rasmussen & Williams, *Gaussian Processes for Machine Learning* (2006), eq. (5.8); values beyond the clip count as
    the clip. Zero without a background.
    """
    if problem.background is None:
        return 0.0
    return _beside_background(problem, before, split) - _beside_background(problem, after, split)


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


def loglik_difference_sds(problem: Problem, best: Fit, others: Sequence[Fit]) -> tuple[float, ...]:
    """Standard deviation of the difference between each fit's minus two log-likelihood and that of the best.

    With the difference D_b over block b of B (see `row_losses`)::

        sd = sqrt(B) * standard deviation of D_b

    The likelihood ratio test of models that are not nested: Vuong, *Econometrica* 57 (1989) 307, eq. (4.2), with blocks
    of rows instead of rows, as these depend on one another; the fits stay as they are (Kishino & Hasegawa, *J. Mol.
    Evol.* 29 (1989) 170). A fit that is worse by less than `SURE` of these would be the better one in some records like
    this. Zero of a record with fewer than MANY_BLOCKS blocks.
    """
    rows = problem.rows("estimate")
    length = int(np.clip(rows.sum() // MANY_BLOCKS, SHORTEST_BLOCK, COMPARISON_BLOCK_ROWS))
    count = int(rows.sum()) // length
    if count < MANY_BLOCKS:
        return tuple(0.0 for _ in others)
    own = row_losses(problem, best, rows)
    deviations = []
    for fit in others:
        blocks = (row_losses(problem, fit, rows) - own)[: count * length].reshape(count, length).sum(axis=1)
        deviations.append(float(np.std(blocks, ddof=1) * np.sqrt(count)))
    return tuple(deviations)


def rows_per_effective_sample(problem: Problem, before: Fit, after: Fit) -> float:
    """Rows for each effective sample of a fit's innovations, averaged by what it gained in each output on another fit.

    With the autocorrelation time t_j of the innovations of output j (see `correlation_times`) and the drop g_j of its
    mean squared error::

        t = sum_j g_j t_j / sum_j g_j

    A disturbance that is slower than any noise of a sensor is not whitened away, and would be counted in every row.
    """
    rows = problem.rows("estimate")
    size = problem.weights * after.noise.stationary_std()
    old, new = (column_means(squared_errors(problem, fit, size, rows)) for fit in (before, after))
    gained = np.maximum(old - new, 0.0)
    if not gained.sum() > 0:
        return 1.0
    innovations = np.clip(np.where(rows[:, None], after.innovations, np.nan), -problem.clip, problem.clip)
    return float(gained @ correlation_times(innovations) / gained.sum())


def worth_its_freedom(problem: Problem, before: Fit, after: Fit) -> bool:
    """Whether what a freer form gains pays for its further coefficients, evidence counted once an effective sample.

    By the Bayesian information criterion of N / t samples, with t of `rows_per_effective_sample` and q coefficients
    more: (drop of minus two log-likelihood) / t > q log(N / t). Schwarz, *Ann. Statist.* 6 (1978) 461.

    Where something else is still missing, neighbouring rows err alike, and a criterion that counts them all would
    take any freedom it can get.
    """
    rows_each = rows_per_effective_sample(problem, before, after)
    further = len(after.names) - len(before.names)
    samples = max(problem.count(problem.rows("estimate")) / rows_each, 2.0)
    return (before.loss - after.loss) / rows_each > further * float(np.log(samples))


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
        errors.append(OutputChange(q.name, q.unit, a, b, sigma, _reduction(old[:, j], new[:, j], block)[1]))
    return tuple(errors)


def column_means(values: FloatArray) -> FloatArray:
    """Mean of each column (m,) of values (n, m), missing ones left out; zero of a column without any."""
    seen = np.isfinite(values)
    means: FloatArray = np.where(seen, values, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return means


def squared_errors(problem: Problem, fit: Fit, size: FloatArray, rows: BoolArray) -> FloatArray:
    """Squared errors of a fit on some rows (rows, m), in units of a size (m,) or (N, m)."""
    squares: FloatArray = ((fit.residual(problem) / size) ** 2)[rows]
    return squares


def block_rows(problem: Problem, before: Fit, after: Fit) -> int:
    """Rows of a block: more than BLOCK_ROWS where what both fits lack is slower than the noise.

    Twice the rows of an effective sample (see `rows_per_effective_sample`): neighbouring blocks are then next to
    independent.
    """
    return max(BLOCK_ROWS, round(2 * rows_per_effective_sample(problem, before, after)))


def _reduction(old: FloatArray, new: FloatArray, block: int) -> tuple[float, tuple[float, float]]:
    """Reduction of the root mean square error with a 95 % interval; squared errors old and new (N,), NaN where missing.

    With the sums O_b and N_b over blocks of neighbouring rows::

        reduction = 1 - sqrt(sum_b N_b / sum_b O_b)

    Pairs (O_b, N_b) are drawn with replacement, and the interval is between quantiles 2.5 and 97.5 % of DRAWS draws:
    the percentile bootstrap (Efron, *Ann. Statist.* 7 (1979) 1) of blocks that do not overlap (Carlstein, *Ann.
    Statist.* 14 (1986) 1171; those of Kunsch, *Ann. Statist.* 17 (1989) 1217, do). Zero with an infinite interval where
    there are fewer than four blocks.
    """
    ok = np.isfinite(old) & np.isfinite(new)
    length = int(np.clip(ok.sum() // MANY_BLOCKS, SHORTEST_BLOCK, block))
    count = int(ok.sum()) // length
    if count < 4 or not old[ok].sum() > 0:
        return 0.0, (float("-inf"), float("inf"))
    a, b = (s[ok][: count * length].reshape(count, -1).sum(axis=1) for s in (old, new))

    def statistic(x: FloatArray, y: FloatArray, axis: int = -1) -> FloatArray:
        value: FloatArray = 1 - np.sqrt(np.sum(y, axis=axis) / np.maximum(np.sum(x, axis=axis), 1e-300))
        return value

    interval = bootstrap(
        (a, b), statistic, paired=True, vectorized=True, n_resamples=DRAWS, method="percentile", rng=0
    ).confidence_interval
    return float(statistic(a, b)), (float(interval.low), float(interval.high))


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
