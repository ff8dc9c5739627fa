"""An effect that adds nothing to the others is not told beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import loglik_difference_sds
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import fitter_about
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Judgement, SearchResult
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.search.simplify import refitted
from adaptive_flot.discovery.verdict.judge import LEAST_MARGIN, judge
from adaptive_flot.greybox.effects import Effect


def without_idle_effects(problem: Problem, result: SearchResult, judged: Judgement) -> tuple[SearchResult, Judgement]:
    """The judgement of an earlier round, where what is told is no better than some of its effects alone.

    The best set of a round is better than that of the round before, but a set without a name, or one that fresh rows
    contradict, gives way to another one. That one need not be: with effects A and B it is told where::

        BIC(A, B) < BIC(A) - LEAST_MARGIN
    """
    best = judged.best
    if judged.word not in WITH_A_NAME or best is None or len(best.names) < 2 or best.adjusted_bic is not None:
        return result, judged
    for earlier in result.rounds:
        alone = next((a for a in earlier.alternatives if _does_as_well(a, best)), None)
        if alone is not None and all(alone.known):
            first = earlier.alternatives[0]
            # a joint search has no rows that it did not fit
            checked = verify(problem, result.base, first.fit, first.problem) if problem.whiten else None
            fewer = replace(result, alternatives=earlier.alternatives, verification=checked)
            return fewer, judge(fewer)
    return without_what_vanished(problem, result, judged)


def without_what_vanished(problem: Problem, result: SearchResult, judged: Judgement) -> tuple[SearchResult, Judgement]:
    """The judgement without an effect whose size has shrunk to nothing beside the others, where it fits as well so.

    An effect is chosen while others are missing. Once they are there its size may be anything about zero. It is left
    out where its coefficients a, with their covariance C, are no evidence, and the fit without it is as good::

        a' C^-1 a < q ln N + LEAST_MARGIN,   BIC(without it) < BIC(with it) + LEAST_MARGIN

    with q coefficients and N measurements. Wald, *Trans. Am. Math. Soc.* 54 (1943) 426. Whatever comes near it with the
    same effect is fitted without it as well: none of them may lose its rivals with it.
    """
    best = judged.best
    if judged.word not in WITH_A_NAME or best is None or len(best.names) < 2 or best.adjusted_bic is not None:
        return result, judged
    if not problem.whiten:  # a joint search weighs its evidence in another way
        return result, judged
    fitter = Fitter(problem)
    price = float(np.log(max(problem.count(fitter.rows), 2)))
    for k, effect in enumerate(best.effects):
        if _evidence(best.fit, effect, price) > LEAST_MARGIN:
            continue
        fewer = _without(fitter, result, best, k)
        if fewer is None or fewer.fit.bic > best.fit.bic + LEAST_MARGIN:
            continue
        name = best.names[k]
        near = [a for a in result.alternatives if a is not best and name in a.names and judged.near(a)]
        again = [_without(fitter, result, a, a.names.index(name)) for a in near]
        earlier = [a for r in result.rounds for a in r.alternatives if len(a.names) == len(fewer.names)]
        by_name: dict[frozenset[tuple[str, str]], Alternative] = {}
        for a in sorted((a for a in (*again, *earlier) if a is not None), key=lambda a: a.fit.bic):
            if set(a.names) != set(fewer.names):
                by_name.setdefault(frozenset(a.names), a)
        rivals = list(by_name.values())
        sds = loglik_difference_sds(problem, fewer.fit, [a.fit for a in rivals])
        compared = (replace(a, loglik_difference_sd=sd) for a, sd in zip(rivals, sds, strict=True))
        ranked = (fewer, *sorted(compared, key=lambda a: a.fit.bic))
        checked = verify(problem, result.base, fewer.fit, fewer.problem)
        without = replace(result, alternatives=ranked, verification=checked)
        return without_what_vanished(problem, without, judge(without))
    return result, judged


def _without(fitter: Fitter, result: SearchResult, a: Alternative, k: int) -> Alternative | None:
    """An alternative without its k-th effect, fitted again from where it stands, at every row where that was needed."""
    fitter = fitter_about(fitter, a.fit)
    others = [replace(e, coefficients={}) for i, e in enumerate(a.effects) if i != k]
    fit = refitted(fitter, result.base, a, others, near=True) if others else None
    if fit is None:
        return None
    names, known = (*a.names[:k], *a.names[k + 1 :]), (*a.known[:k], *a.known[k + 1 :])
    return Alternative(names, known, fit, result.base.loss - fit.loss, fit.bic - result.base.bic)


def _evidence(fit: Fit, effect: Effect, price: float) -> float:
    """Wald's statistic of an effect's size being none, less the price of its coefficients; infinite where unknown."""
    names = [effect.parameter(c.name) for c in effect.terms if not c.is_shape]
    where = [fit.names.index(n) for n in names if n in fit.names]
    if not where or len(fit.covariance) <= max(where):
        return np.inf
    values, covariance = fit.values[where], fit.covariance[np.ix_(where, where)]
    if not np.isfinite(covariance).all():
        return np.inf
    free = sum(effect.parameter(c.name) in fit.names for c in effect.terms)
    return float(values @ np.linalg.pinv(covariance, hermitian=True) @ values) - price * free


def _does_as_well(a: Alternative, best: Alternative) -> bool:
    """Whether some of the effects of the best come within a margin of it."""
    return set(a.names) < set(best.names) and a.adjusted_bic is None and a.fit.bic <= best.fit.bic + LEAST_MARGIN
