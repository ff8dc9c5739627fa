"""Joint search: several effects at once, where the search of one effect after the other ends far above the noise.

A model that lacks several effects, each of which hides the others, has many local fits; a record that is cheap to
simulate allows to look for the best one from scattered starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.discovery.results import Round, SearchResult
from adaptive_flot.discovery.search.joint_fits import (
    LAST_STEPS,
    JointFits,
    correlation_time,
    cost_of_a_run,
    cross_validated,
    discount,
    discounted,
)
from adaptive_flot.discovery.search.rounds import scorer_of, what_is_left

CHEAP = 30_000
"""Steps of a record times squared states up to which hundreds of fits are a matter of a minute."""
MOST_AT_ONCE = 4
DOMINATES = 3.0
"""Model error this many times as large as the noise is what a noise model would wrongly explain."""


def wants_joint(problem: Problem, result: SearchResult) -> bool:
    """Whether fits are cheap and the error of the best alternative outweighs the noise by far."""
    if problem.time_is_up or problem.background is not None:
        return False
    best = result.alternatives[0].fit if result.alternatives else result.base
    return cost_of_a_run(problem, best) <= CHEAP and dominated(problem, best)


def dominated(problem: Problem, fit: Fit) -> bool:
    """Whether the error of a fit outweighs the noise by far; noise by differences, which needs no model."""
    rows = problem.rows("estimate")
    error = np.sqrt(np.nanmean(fit.residual(problem)[rows] ** 2, axis=0))
    noise = np.nan_to_num(noise_by_differences(problem.measured))
    return bool(np.any(error > DOMINATES * np.maximum(noise, problem.floor)))


def search_jointly(
    problem: Problem,
    one_by_one: SearchResult,
    *,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[Problem, SearchResult]:
    """Search combinations of named effects.

    Residuals are neither whitened nor clipped: the error of such a model outweighs the noise by far, a noise model
    would explain it away, and its largest values are what is looked for. As neighbouring errors are
    alike, evidence counts by the number of effective samples. All rows but the report split choose, since events are
    few; the choice is confirmed by predictions of each block from fits that did not see it.

    Parameters
    ----------
    problem, found
        The record and what the search of one effect after the other found.
    processes, progress
        As for `search`.

    Returns
    -------
    tuple of Problem and SearchResult
        The problem as it was searched, and what was found; both unchanged when no combination brings evidence.
    """
    chosen = np.where(problem.splits == "confirm", "estimate", problem.splits)
    plain = replace(problem, whiten=False, splits=chosen, weights=np.ones_like(problem.weights))
    base = Fitter(plain).fit(one_by_one.base.model, like=one_by_one.base, rounds=2, steps=LAST_STEPS) or one_by_one.base
    say = "fit several effects at once"
    progress(say)
    scorer, _ = scorer_of(plain, base)
    rounds = [r for r in JointFits(plain, base, scorer, processes).rounds(MOST_AT_ONCE, lambda: progress(say)) if r]
    if not rounds:
        return problem, one_by_one
    rows_per_effective_sample = correlation_time(plain, min((r[0] for r in rounds), key=lambda a: a.fit.loss).fit)
    base = discount(plain, base, rows_per_effective_sample)
    scores = tuple(scorer.scores())
    tables = [Round(scores, LEAST_EVIDENCE, discounted(plain, base, r, rows_per_effective_sample)) for r in rounds]
    best: Round | None = None
    for table in tables:
        reference = best.alternatives[0].fit if best else base
        if table.alternatives[0].fit.bic < reference.bic - LEAST_EVIDENCE:
            best = table
    if best is None or not _better(plain, base, best.alternatives[0].fit, one_by_one, rows_per_effective_sample):
        return problem, one_by_one
    progress("confirm")
    chosen_fit = best.alternatives[0].fit
    seen = replace(plain, splits=np.where(chosen == "estimate", "confirm", chosen))
    checked = verify(seen, cross_validated(plain, base, processes), cross_validated(plain, chosen_fit, processes))
    checked = replace(checked, where="by cross-validation, on rows that also helped to choose the effects")
    left = _left(plain, chosen_fit, rows_per_effective_sample)
    return plain, replace(
        one_by_one,
        base=base,
        rounds=tuple(tables),
        alternatives=best.alternatives,
        verification=checked,
        left=left,
        left_threshold=LEAST_EVIDENCE,
        rows_per_effective_sample=1.0,
    )


def _better(
    problem: Problem, base: Fit, joint: Fit, one_by_one: SearchResult, rows_per_effective_sample: float
) -> bool:
    """Whether effects that were found at once beat what one after the other came to, fitted to the same rows."""
    if not one_by_one.alternatives:
        return True
    one = one_by_one.alternatives[0].fit
    again = Fitter(problem).fit(one.model, one.names, like=one, rounds=2, steps=LAST_STEPS)
    return again is None or joint.bic < discount(problem, again, rows_per_effective_sample).bic - LEAST_EVIDENCE


def _left(problem: Problem, fit: Fit, rows_per_effective_sample: float) -> float:
    """First-order gain that one more effect would bring, in terms of what the fit leaves, by effective samples.

    With the share R^2 of the squared residual that the best candidate explains, N measurements and t rows an effective
    sample: -(N / t) log(1 - R^2), the likelihood ratio of a regression with its noise estimated.
    """
    scorer, _ = scorer_of(problem, fit)
    gain, _ = what_is_left(scorer, LEAST_EVIDENCE)
    explained = min(gain / max(float(np.sum(scorer.residual**2)), 1e-300), 0.99)
    return -problem.count(problem.rows("estimate")) * float(np.log(1 - explained)) / rows_per_effective_sample
