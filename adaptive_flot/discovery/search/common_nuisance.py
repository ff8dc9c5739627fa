"""Whether rivals stay apart from the best once what all of them lack, a common nuisance, is added to each.

What the best alternative leaves unexplained (a feed that wanders beside the effect that is looked for) makes every
comparison uncertain by as much. With the same further effect in each, that uncertainty falls away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from adaptive_flot.discovery.assessment.likelihood import loglik_difference_sds
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.candidates.catalogue import finer
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, SearchResult
from adaptive_flot.discovery.search.alternatives import fit_variant, variant_model
from adaptive_flot.discovery.search.rounds import scorer_of, threshold_of, what_is_left
from adaptive_flot.greybox.forms.form import FormKind
from adaptive_flot.parallel import parallel_map

MINOR = 0.5
"""What is left must be less than this share of what the best has gained: else it is the matter, and not beside it."""
MOST_RIVALS = 8


def adjust_for_common_nuisance(
    problem: Problem, result: SearchResult, near: Sequence[Alternative], processes: int = 1
) -> SearchResult:
    """The search with its best and those that are `near` it compared anew, each with what the best one lacks added.

    Unchanged when nothing of the kind is left, when too many are near, or when who wins does not stand on fresh rows.
    """
    best = result.alternatives[0]
    if not 0 < len(near) <= MOST_RIVALS:
        return result
    score = _lacking(scorer_of(problem, best.fit)[0], best)
    if score is None or score.gain > MINOR * best.gain:
        return result
    nuisance = score.candidate.name
    fitter = Fitter(problem)
    score = _shaped(fitter, best, score)
    if score is None:
        return result
    taking = [best, *(a for a in near if nuisance not in a.names)]
    fits = parallel_map(lambda k: fit_variant(fitter, taking[k].fit, score, MOST_STEPS), range(len(taking)), processes)
    adjusted = {
        a.names: fit.with_model(partial(variant_model, a.fit, score))
        for a, fit in zip(taking, fits, strict=True)
        if fit
    }
    if len(adjusted) < len(taking):
        return result
    # a rival that is the nuisance itself is compared with the best that has it: if that is better, it alone is not all
    adjusted |= {a.names: a.fit for a in near if nuisance in a.names}
    winner = min((best, *near), key=lambda a: adjusted[a.names].bic)
    checked = result.verification if winner is best else verify(problem, result.base, winner.fit)
    if winner.names == (nuisance,) or checked is None or not checked.confirmed:
        return result
    differences = loglik_difference_sds(problem, adjusted[winner.names], list(adjusted.values()))
    after = {n: (fit.bic, d) for (n, fit), d in zip(adjusted.items(), differences, strict=True)}
    changed = [
        replace(a, adjusted_bic=after[a.names][0], loglik_difference_sd=after[a.names][1]) if a.names in after else a
        for a in result.alternatives
    ]
    changed.sort(key=lambda a: (a.adjusted_bic is None, a.fit.bic if a.adjusted_bic is None else a.adjusted_bic))
    scorer, _ = scorer_of(problem, adjusted[winner.names])
    left, threshold = what_is_left(scorer, threshold_of(scorer))
    return replace(
        result,
        alternatives=tuple(changed),
        verification=checked,
        left=left,
        left_threshold=threshold,
        common_nuisance=nuisance,
    )


def _shaped(fitter: Fitter, best: Alternative, score: Score) -> Score | None:
    """The nuisance, as fine and as large as it comes beside the best; None when that can not be fitted."""
    first = fit_variant(fitter, best.fit, score, MOST_STEPS)
    if first is None:
        return None
    start = dict(first.model.fitted_effects()[-1].coefficients)
    fine = finer(score.variant, start) if score.candidate.driver == "time" else None
    return replace(score, variant=fine[0], start=fine[1]) if fine else replace(score, start=start)


def _lacking(scorer: Scorer, best: Alternative) -> Score | None:
    """The best-scored candidate that is not of the best's own names, as a curve, a power law or a constant."""
    for score in scorer.scores():
        if score.candidate.name in best.names:
            continue
        variants = scorer.variant_scores(score.candidate)
        for kind in (FormKind.CURVE, FormKind.LINE, FormKind.CONSTANT):
            for variant in variants:
                if variant.variant.effect.family.kind is kind:
                    return variant
    return None
