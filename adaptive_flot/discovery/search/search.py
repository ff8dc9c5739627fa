"""The search: rounds of score, refit and compare, until nothing of substance is left to explain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.verification import loglik_difference_sds, rows_per_effective_sample, verify
from adaptive_flot.discovery.candidates.catalogue import catalogue
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.step_events import SLOW_ROWS, SLOW_S
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Round, SearchResult
from adaptive_flot.discovery.search.alternatives import SHORTLIST, shortlist, with_each_output
from adaptive_flot.discovery.search.fit_jobs import ScoredLinearisation
from adaptive_flot.discovery.search.simplify import simpler
from adaptive_flot.discovery.search.substance import better, excess, still_wrong, worth_extending
from adaptive_flot.discovery.search.successive_halving import refit
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS
from adaptive_flot.greybox.model import Model

MOST_EFFECTS = 3
NEAR = 0.25
"""Share of its own value within which an adapted parameter counts as near: more than the drifts that are known."""
NULL_DRAWS = 200
NULL_QUANTILE = 0.99
LEAST_EVIDENCE = 10.0
"""Drop of the information criterion that an effect must bring."""
FLAT = 0.02
"""A dependence must remove at least this share of the excess error beyond what the constant at its site removes."""
SHORTLIST_NEAR, SHORTLIST_FURTHER = 9, 5
"""Candidates that are refitted where two linearisations propose them, and as further effects."""
BEAM = 2
"""Alternatives of one round that the next extends."""


def search(
    problem: Problem,
    base: Fit,
    nominal: Model,
    *,
    responses: Responses | None = None,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> SearchResult:
    """Search effects on top of a base fit.

    Parameters
    ----------
    problem, base
        The record and the fit of the model as it is, on the estimation split.
    nominal
        The model with the parameter values it came with.
    responses
        Responses along the base fit, where they are known already.
    processes
        Fits that run at once.
    progress
        Called with a word for each stage.
    """
    fitter = Fitter(problem)
    progress("score")
    scorer, sites = scorer_of(problem, base, responses)
    near = _near(fitter, base, nominal)
    scorers = [scorer] if near is None else [scorer, scorer_of(problem, near)[0]]
    rounds = [_round(problem, fitter, base, scorers, [None], processes, progress)]
    accepted: list[Round] = []
    best: Alternative | None = None
    left = what_is_left(scorer, rounds[0].threshold)
    while better(problem, base, best, rounds[-1]):
        accepted.append(rounds[-1])
        best = rounds[-1].alternatives[0]
        progress("what is left")
        scorer, _ = scorer_of(problem, best.fit)
        left = what_is_left(scorer, threshold_of(scorer))
        if len(best.names) == MOST_EFFECTS or not worth_extending(problem, base, best, left) or problem.time_is_up:
            break
        beam = _beam(rounds[-1], best, BEAM)
        rounds.append(_round(problem, fitter, base, [scorer], beam, processes, progress))
    slow_s = max(SLOW_S, SLOW_ROWS * problem.record.dt)
    return _confirmed(problem, SearchResult(base, tuple(rounds), (), None, *left, sites, slow_s=slow_s), accepted)


def _near(fitter: Fitter, base: Fit, nominal: Model) -> Fit | None:
    """A fit whose adapted parameters stay near the model's own, where those of the base fit have run away.

    A missing effect can drive them far off; the responses along such a run say little about the effects of the plant.
    """
    names = fitter.problem.adapted
    own = {n: nominal.parameters[nominal.index("parameters", n)].value for n in names}
    far = [abs(v / own[n] - 1) > NEAR for n, v in zip(names, base.values, strict=False) if own[n]]
    if not any(far) or not nominal.starts_steady:
        return None
    bounds = {n: (v - NEAR * abs(v), v + NEAR * abs(v)) for n, v in own.items() if v}
    return fitter.fit(nominal, bounds=bounds, rounds=2)


def _confirmed(problem: Problem, result: SearchResult, accepted: list[Round]) -> SearchResult:
    """Keep the largest model that stands on the confirm split; failing that, the first, with what it left."""
    for r in reversed(accepted):
        verification = verify(problem, result.base, r.alternatives[0].fit)
        if verification.confirmed or r is accepted[0]:
            last = r is accepted[-1]
            left = result.left if last else max(result.left, r.alternatives[0].fit.bic - _best_bic(accepted))
            best = r.alternatives[0].fit
            rows_each = rows_per_effective_sample(problem, result.base, best)
            differences = loglik_difference_sds(problem, best, [a.fit for a in r.alternatives])
            compared = tuple(
                replace(a, loglik_difference_sd=d) for a, d in zip(r.alternatives, differences, strict=True)
            )
            return replace(
                result, alternatives=compared, verification=verification, left=left, rows_per_effective_sample=rows_each
            )
    return result


def _best_bic(rounds: list[Round]) -> float:
    return min(a.fit.bic for r in rounds for a in r.alternatives)


def scorer_of(problem: Problem, fit: Fit, responses: Responses | None = None) -> tuple[Scorer, tuple[str, ...]]:
    """Scores along a fit, and the sites whose constant change is that of an adapted parameter.

    `responses` are those along this fit, where they are known already.
    """
    responses = responses or Responses(problem, fit)
    return Scorer(problem, fit, responses, catalogue(fit.model, responses)), responses.adapted_sites()


def threshold_of(scorer: Scorer) -> float:
    """Penalised score that noise alone passes once in a hundred records: a quantile of `Scorer.null_gains`.

    At least LEAST_EVIDENCE: a difference of 10 in BIC is "very strong" evidence (Kass & Raftery, *J. Am. Statist.
    Assoc.* 90 (1995) 773).
    """
    return max(LEAST_EVIDENCE, float(np.quantile(scorer.null_gains(NULL_DRAWS, seed=0), NULL_QUANTILE)))


def what_is_left(scorer: Scorer, threshold: float) -> tuple[float, float]:
    """First-order gain of the best candidate that is left, and the threshold it is held against."""
    scores = scorer.scores()
    return (scores[0].gain if scores else 0.0), threshold


def _round(
    problem: Problem,
    fitter: Fitter,
    base: Fit,
    scorers: list[Scorer],
    beam: list[Alternative | None],
    processes: int,
    progress: Callable[[str], None],
) -> Round:
    threshold = max(map(threshold_of, scorers))
    scores = tuple(scorers[0].scores())
    alternatives: list[Alternative] = []
    compared = True
    for k, before in enumerate(beam):
        if before is not None and k:
            scorers = [scorer_of(problem, before.fit)[0]]
        linearisations = []
        most = SHORTLIST_FURTHER if before else SHORTLIST if len(scorers) == 1 else SHORTLIST_NEAR
        for scorer in scorers:
            wanted = shortlist(scorer, most)
            if before is not None:
                # a further effect must have a name: a pair of curves without one would explain anything
                wanted = [s for s in wanted if s.candidate.known]
                wanted = with_each_output(scorer, wanted, still_wrong(problem, before.fit))
            wanted = [s for s in wanted if s.penalised > threshold]
            linearisations.append(ScoredLinearisation(scorer, wanted))
        progress("fit")
        fitted, all_of_them = refit(fitter, base, linearisations, before, processes, lambda s: progress(f"fit {s}"))
        alternatives += fitted
        compared = compared and all_of_them
    if alternatives and beam[0] is not None and not problem.time_is_up:
        alternatives += simpler(fitter, base, min(alternatives, key=lambda a: a.fit.bic))
    unique: dict[frozenset[tuple[str, str]], Alternative] = {}
    for a in sorted(alternatives, key=lambda a: a.fit.bic):
        unique.setdefault(frozenset(a.names), a)
    return Round(scores, threshold, _without_flat(problem, base, list(unique.values())), compared)


def _without_flat(problem: Problem, base: Fit, alternatives: list[Alternative]) -> tuple[Alternative, ...]:
    """Leave out dependences that turned out flat: those that add next to nothing to a constant at the same site."""
    by_names = {frozenset(a.names): a for a in alternatives}

    def flat(a: Alternative) -> bool:
        for k, (site, driver) in enumerate(a.names):
            constant = by_names.get(frozenset((*a.names[:k], (site, "constant"), *a.names[k + 1 :])))
            if driver in DYNAMIC_DRIVERS or driver == "constant" or constant is None:
                continue
            if excess(problem, constant.fit, a.fit) < FLAT * excess(problem, base, a.fit):
                return True
        return False

    return tuple(a for a in alternatives if not flat(a))


def _beam(last: Round, best: Alternative, width: int) -> list[Alternative | None]:
    others = [a for a in last.alternatives if a is not best and all(a.known)]
    return [best, *others[: width - 1]]
