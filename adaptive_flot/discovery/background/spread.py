"""Whether there is a background, and its numbers: it competes with the effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.background.evidence import LARGEST, Evidence, Spread, cost
from adaptive_flot.discovery.background.fitting import fit_with_background, spread_along, without_background
from adaptive_flot.discovery.background.linear import feeds_unseen, uncertain_constants
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.search.alternatives import fit_variant, shortlist
from adaptive_flot.discovery.search.rounds import scorer_of

LEAST_SPAN_S = 7200.0
"""In a shorter record what wanders over a quarter of an hour is no more than a trend, or an event; and it says too
little to tell a dozen constants beside an effect."""
MOST_BEFORE, FITTED = 3, 2
"""Effects that are fitted one on top of the other before a background is looked for, and how many are tried for
each."""
BLOCK_ROWS = 24
"""Rows of a split beside a feed that wanders: more than noise remembers, and short against the feed. So held-out rows
say more of an effect than of the feed, and a change that lasts for some minutes has rows of each split."""


def may_have_background(problem: Problem, responses: Responses) -> bool:
    """Whether a record is long enough, and its model has a feed that may wander or constants that may be off."""
    time = problem.record.time
    long = time[-1] - time[0] >= LEAST_SPAN_S
    return long and bool(feeds_unseen(problem, responses) or uncertain_constants(responses))


def spread_of(problem: Problem, base: Fit, responses: Responses, scorer: Scorer | None = None) -> Spread | None:
    """The background of a record, where that explains the residual better than any effect; else None.

    It competes with the effects. Where one of these explains more to first order (see `evidence`), the best is fitted
    first, and the background is looked for in what that leaves; MOST_BEFORE at most, and one at least: an effect
    that is far from linear must not be taken for a background. Where it explains more than any effect does nowhere,
    all that were tried count. Each is looked for once more, along the fit that has it. Of those beside more or fewer
    effects, that one counts whose fit together with them is best, by LEAST_EVIDENCE for each more: a wrong effect
    leaves more for the background. It must be better than the effects alone. Constants that are off, by themselves,
    need only be as good. A store whose sizes were 3 to 10 % off was named as one that depends on the water drawn.

    Parameters
    ----------
    problem, base
        The record, and the fit of the model as it is.
    responses, scorer
        Responses along that fit, and scores along it where they are known already.
    """
    if not may_have_background(problem, responses):
        return None
    feeds, tried = feeds_unseen(problem, responses), list[_Tried]()
    fit, scorer, alone = base, scorer or scorer_of(problem, base, responses)[0], base.bic
    for before in range(MOST_BEFORE + 1):
        evidence = Evidence(problem, scorer, responses, feeds)
        best = evidence.best
        if best.evidence <= LEAST_EVIDENCE:
            break
        # a free curve in time at any site that acts on the same output is what a course would be taken for: no rival
        rival = max((s.penalised for s in scorer.scores() if not _free_in_time(s)), default=0.0)
        explains = best.evidence > rival
        tried.append(_Tried(evidence.but_for_what_stands_out(best), fit, responses, explains))
        extended = (
            _with_best_effect(problem, fit, scorer) if before < MOST_BEFORE and not (before and explains) else None
        )
        if extended is None:
            break
        fit, responses = extended, Responses(problem, extended)
        scorer, alone = scorer_of(problem, fit, responses)[0], min(alone, fit.bic)
    chosen, least, by_itself = None, np.inf, False
    for t in [t for t in tried if t.explains] or tried:
        spread, own = min(_fitted(problem, t, feeds), key=lambda found: found[1], default=(None, np.inf))
        if own < least - LEAST_EVIDENCE:
            chosen, least, by_itself = spread, own, t.fit is base
    if chosen is None or chosen.share >= LARGEST:  # what fits best as far as the last of the sizes is something else
        return None
    # constants are always a little off: where they alone explain as much as an effect, that is what they are
    as_good = by_itself and chosen.course is None and alone < base.bic
    return chosen if least < alone + (LEAST_EVIDENCE if as_good else -LEAST_EVIDENCE) else None


@dataclass(frozen=True)
class _Tried:
    """A background that was found along a fit, and whether it explains more than any further effect does there."""

    spread: Spread
    fit: Fit
    responses: Responses
    explains: bool


def _fitted(problem: Problem, tried: _Tried, feeds: Sequence[str]) -> list[tuple[Spread, float]]:
    """A background, and what is found along the fit that has it, each with the BIC of its fit and its own numbers."""
    first = tried.spread
    fitted = fit_with_background(problem, first, tried.fit, tried.responses, turns=0)
    if fitted is None:
        return []
    found = [(first, cost(problem, fitted[1], first.numbers))]
    more = spread_along(problem, *fitted, feeds)
    bare = without_background(*fitted)
    if more.numbers and (again := fit_with_background(problem, more, bare, Responses(problem, bare), turns=0)):
        found.append((more, cost(problem, again[1], more.numbers)))
    return found


def _with_best_effect(problem: Problem, fit: Fit, scorer: Scorer) -> Fit | None:
    """The fit with the best of the few effects that score best on top; None where none brings evidence.

    A free curve in time is none of them: it would be the course of the feed, at any site that acts on the same output.
    """
    fitter = Fitter(problem)
    named = [score for score in shortlist(scorer) if not _free_in_time(score)]
    fits = [fit_variant(fitter, fit, score, MOST_STEPS) for score in named[:FITTED]]
    good = [again for again in fits if again is not None and again.bic < fit.bic - LEAST_EVIDENCE]
    return min(good, key=lambda again: again.bic, default=None)


def _free_in_time(score: Score) -> bool:
    return score.candidate.driver == "time" and score.variant.effect.family.is_curve
