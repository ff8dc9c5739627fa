"""The search: rounds of score, refit and compare, until nothing of substance is left to explain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from adaptive_flot.discovery.assessment.likelihood import (
    difference_with_confirm_rows,
    loglik_difference_sds,
    rows_per_effective_sample,
)
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.shapes.step_events import SLOW_ROWS, SLOW_S
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, FirstRound, Round, SearchResult
from adaptive_flot.discovery.search.exchange import with_exchanges
from adaptive_flot.discovery.search.rounds import run_round, scorer_of, threshold_of, what_is_left
from adaptive_flot.discovery.search.substance import better, worth_extending
from adaptive_flot.greybox.model import Model

MOST_EFFECTS = 3
NEAR = 0.25
"""Share of its own value within which an adapted parameter counts as near: more than the drifts that are known."""
BEAM = 2
"""Alternatives of one round that the next extends."""


def first_round(
    problem: Problem,
    base: Fit,
    nominal: Model,
    *,
    scored: tuple[Scorer, tuple[str, ...]] | None = None,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> FirstRound:
    """Single effects on top of a base fit; arguments are as in `search`.

    `scored` is what `scorer_of` gives for the base fit, where it is known already.
    """
    fitter = Fitter(problem)
    scorer, sites = scored or scorer_of(problem, base)
    near = _near(fitter, base, nominal)
    scorers = [scorer] if near is None else [scorer, scorer_of(problem, near)[0]]
    return FirstRound(scorer, sites, run_round(fitter, base, scorers, [None], processes, progress))


def search(
    problem: Problem,
    base: Fit,
    nominal: Model,
    *,
    first: FirstRound | None = None,
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
    first
        What `first_round` gives for them, where it is known already.
    processes
        Fits that run at once.
    progress
        Called with a word for each stage.
    """
    fitter = Fitter(problem)
    first = first or first_round(problem, base, nominal, processes=processes, progress=progress)
    rounds = [first.round]
    accepted: list[Round] = []
    best: Alternative | None = None
    beam: list[Alternative | None] = [None]
    left = what_is_left(first.scorer, rounds[0].threshold)
    while better(problem, base, best, rounds[-1]):
        if best is not None:
            rounds[-1] = with_exchanges(fitter, base, rounds[-1], beam, processes, progress)
        accepted.append(rounds[-1])
        best = rounds[-1].alternatives[0]
        progress("what is left")
        scorer, _ = scorer_of(problem, best.fit)
        left = what_is_left(scorer, threshold_of(scorer))
        if len(best.names) == MOST_EFFECTS or not worth_extending(problem, base, best, left) or problem.time_is_up:
            break
        beam = _beam(rounds[-1], best, BEAM)
        rounds.append(run_round(fitter, base, [scorer], beam, processes, progress))
    slow_s = max(SLOW_S, SLOW_ROWS * problem.record.dt)
    return _confirmed(problem, SearchResult(base, tuple(rounds), (), None, *left, first.sites, slow_s=slow_s), accepted)


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
            compared = _compared(problem, r.alternatives)
            return replace(
                result, alternatives=compared, verification=verification, left=left, rows_per_effective_sample=rows_each
            )
    return result


def _compared(problem: Problem, alternatives: tuple[Alternative, ...]) -> tuple[Alternative, ...]:
    """Alternatives with how certain their difference from the best is; those to a pulse on the confirm rows as well."""
    best, others = alternatives[0], alternatives[1:]
    if not all(e.family.passes for e in best.effects):
        deviations = loglik_difference_sds(problem, best.fit, [a.fit for a in others])
        told = (replace(a, loglik_difference_sd=d) for a, d in zip(others, deviations, strict=True))
        return best, *told
    compared = [replace(best, adjusted_bic=best.fit.bic)]
    for a in others:
        more, deviation = difference_with_confirm_rows(problem, best.fit, a.fit)
        compared.append(replace(a, adjusted_bic=a.fit.bic + more, loglik_difference_sd=deviation))
    return tuple(compared)


def _best_bic(rounds: list[Round]) -> float:
    return min(a.fit.bic for r in rounds for a in r.alternatives)


def _beam(last: Round, best: Alternative, width: int) -> list[Alternative | None]:
    others = [a for a in last.alternatives if a is not best and all(a.known)]
    return [best, *others[: width - 1]]
