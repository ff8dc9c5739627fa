"""One round of the search: score, refit and compare candidates on top of what was found before."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.candidates.catalogue import catalogue
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.shapes.pulses import with_pulses
from adaptive_flot.discovery.candidates.shapes.relays import with_relays
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.discovery.search.alternatives import SHORTLIST, shortlist, with_each_output, with_hidden
from adaptive_flot.discovery.search.halving.jobs import ScoredLinearisation
from adaptive_flot.discovery.search.halving.successive_halving import refit
from adaptive_flot.discovery.search.simplify import simpler
from adaptive_flot.discovery.search.substance import excess, repairs, still_wrong
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS

NULL_DRAWS = 200
NULL_QUANTILE = 0.99
FLAT = 0.02
"""A dependence must remove at least this share of the excess error beyond what the constant at its site removes."""
SHORTLIST_NEAR, SHORTLIST_FURTHER = 9, 5
"""Candidates that are refitted where two linearisations propose them, and as further effects."""


def run_round(
    fitter: Fitter,
    base: Fit,
    scorers: list[Scorer],
    beam: list[Alternative | None],
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
    further: int = SHORTLIST_FURTHER,
    rival: Alternative | None = None,
) -> Round:
    """Fit the candidates that score best on top of each alternative of the beam, and rank what they came to.

    Parameters
    ----------
    fitter, base
        The fitter of the record, and the fit of the model as it is.
    scorers
        Scores along the first of the beam, from one or two linearisations.
    beam
        What is extended; None for the model as it is.
    processes, progress
        As in `search`.
    further
        Candidates that are refitted as further effects.
    rival
        A set of as many effects that is known already: what does not come near it after a few steps is left there.
    """
    problem, threshold = fitter.problem, max(map(threshold_of, scorers))
    scores = tuple(scorers[0].scores())
    alternatives: list[Alternative] = []
    compared = True
    for k, before in enumerate(beam):
        if before is not None and k:
            scorers = [scorer_of(problem, before.fit)[0]]
        linearisations = []
        most = further if before else SHORTLIST if len(scorers) == 1 else SHORTLIST_NEAR
        for scorer in scorers:
            ranking = with_relays(scorer, scorer.scores())
            # a further effect that comes and goes would be whatever the first ones leave
            wanted = shortlist(scorer, most, ranking if before else with_pulses(scorer, ranking))
            wanted = with_hidden(wanted, ranking)
            if before is not None:
                # a further effect must have a name: a pair of curves without one would explain anything
                wanted = [s for s in wanted if s.candidate.known]
                wanted = with_each_output(scorer, wanted, still_wrong(problem, before.fit))
            wanted = [s for s in wanted if s.penalised > threshold]
            linearisations.append(ScoredLinearisation(scorer, wanted))
        progress("fit")
        rival = min([*filter(None, [rival]), *alternatives], key=lambda a: a.fit.bic, default=None)
        fitted, all_of_them = refit(
            fitter, base, linearisations, before, processes, lambda s: progress(f"fit {s}"), rival
        )
        alternatives += fitted
        compared = compared and all_of_them
    if alternatives and beam[0] is not None and not problem.time_is_up:
        alternatives += simpler(fitter, base, min(alternatives, key=lambda a: a.fit.bic))
    return Round(scores, threshold, ranked(problem, base, alternatives), compared)


def ranked(problem: Problem, base: Fit, alternatives: list[Alternative]) -> tuple[Alternative, ...]:
    """The best fit of each set of names, best first.

    Left out are dependences that turned out flat: those that add next to nothing to a constant at the same site. Beside
    another effect they must add next to nothing to any output: one that is far off for another cause hides the rest.
    """
    unique: dict[frozenset[tuple[str, str]], Alternative] = {}
    for a in sorted(alternatives, key=lambda a: a.fit.bic):
        unique.setdefault(frozenset(a.names), a)
    kept = list(unique.values())
    by_names = {frozenset(a.names): a for a in kept}

    def flat(a: Alternative) -> bool:
        for k, (site, driver) in enumerate(a.names):
            constant = by_names.get(frozenset((*a.names[:k], (site, "constant"), *a.names[k + 1 :])))
            if driver in DYNAMIC_DRIVERS or driver == "constant" or constant is None:
                continue
            little = excess(problem, constant.fit, a.fit) < FLAT * excess(problem, base, a.fit)
            if little and (len(a.names) == 1 or not repairs(problem, base, constant.fit, a.fit, FLAT)):
                return True
        return False

    return tuple(a for a in kept if not flat(a))


def scorer_of(
    problem: Problem, fit: Fit, responses: Responses | None = None, noise: Noise | None = None
) -> tuple[Scorer, tuple[str, ...]]:
    """Scores along a fit, and the sites whose constant change is that of an adapted parameter.

    `responses` are those along this fit, and `noise` its noise model, where they are known already.
    """
    responses = responses or Responses(problem, fit)
    return Scorer(problem, fit, responses, catalogue(fit.model, responses), noise), responses.adapted_sites()


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
