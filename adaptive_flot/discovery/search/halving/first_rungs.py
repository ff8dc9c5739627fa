"""The first two rungs: everyone with a few steps, then the finalists in several forms to the end."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.candidates.catalogue import finer
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, ScoredLinearisation, is_curve
from adaptive_flot.discovery.search.halving.refits import Refit

FIRST_STEPS = 6
"""Steps of the first rung, in which every candidate takes part."""
FINALISTS, MOST_FINALISTS = 4, 7
"""Finalists, and how many with those that tie with the best one to first order."""
SURE_FINALISTS = 3
NEAR_FINALIST = 0.5
"""A finalist beyond the third must have gained at least this share of what the first gained."""
FORMS_EACH = 3


def first(refit: Refit) -> list[FittedJob]:
    """Everyone, a few steps."""
    entries = [
        Job(i, f)
        for i, linearisation in enumerate(refit.linearisations)
        for s in linearisation.scores
        for f in first_forms(linearisation, s)
    ]
    return refit.run(entries, FIRST_STEPS)


def last(refit: Refit, first: list[FittedJob]) -> list[FittedJob]:
    """The finalists in several forms, to the end."""
    furthest: dict[tuple[str, str], FittedJob] = {}
    for fitted in first:
        furthest.setdefault(fitted.score.candidate.name, fitted)
    chosen = finalists(refit.start(0).loss, list(furthest.values()), refit.tied())
    drawn = {(f.linearisation, f.score.candidate.name): f for f in reversed(first) if is_curve(f)}
    coarse = [drawn.get((f.linearisation, f.score.candidate.name), f) for f in chosen]
    jobs = [job for f in coarse for job in forms(refit.linearisations[f.linearisation], f)]
    return refit.run([*jobs, *_switches(refit, {f.score.candidate.name for f in chosen})])


def finalists(loss: float, ranked: list[FittedJob], tied: set[tuple[str, str]]) -> list[FittedJob]:
    """Who goes on: the first few, more that come near them or tie with them to first order (few steps tell little).

    `loss` is that of the model as it is.
    """
    gains = [max(loss - fitted.alternative.fit.loss, 0.0) for fitted in ranked]
    chosen = [
        f
        for i, (f, gain) in enumerate(zip(ranked, gains, strict=True))
        if i < SURE_FINALISTS or (i < FINALISTS and gain > NEAR_FINALIST * gains[0]) or f.score.candidate.name in tied
    ]
    return chosen[:MOST_FINALISTS]


def _switches(refit: Refit, names: set[tuple[str, str]]) -> list[Job]:
    """Switches by a signal of these names, from each linearisation that proposes one.

    A few steps tell little of them: the name may have come further as a curve, along another linearisation.
    """
    return [
        Job(i, s)
        for i, linearisation in enumerate(refit.linearisations)
        for s in linearisation.scores
        if s.candidate.name in names and s.variant.effect.family.memory
    ]


def first_forms(linearisation: ScoredLinearisation, score: Score) -> list[Score]:
    """The forms of the first rung: the best one, for what depends on time its curve too, and what a switch replaced."""
    if score.variant.effect.family.memory:  # what turns with a sign looks like a switch at it
        best, *others = linearisation.scorer.variant_scores(score.candidate)
        return [score, best, *(s for s in others if _turns(s))]
    if score.candidate.driver != "time":  # to first order a curve bends towards any turn
        return [score, *(s for s in linearisation.scorer.variant_scores(score.candidate) if _turns(s) and s != score)]
    curves = [s for s in linearisation.scorer.variant_scores(score.candidate) if s.variant.effect.family.is_curve][:1]
    return [score] if score.variant.effect.family.is_curve else [score, *curves]


def forms(linearisation: ScoredLinearisation, fitted: FittedJob) -> list[Job]:
    """Best variant of each form (and mode) of a candidate that comes near the best, from where the first rung ended."""
    name, ended = fitted.score.candidate.name, fitted.alternative
    score = next(s for s in linearisation.scores if s.candidate.name == name)
    best_of_form: dict[tuple[str, str | None], Score] = {}
    for s in linearisation.scorer.variant_scores(score.candidate):
        key = s.variant.effect.form, s.variant.effect.mode
        if key not in best_of_form and (s.gain > 0.5 * score.gain or _turns(s)):
            best_of_form[key] = s
    in_time = score.candidate.driver == "time"
    kept = list(best_of_form.values())[:FORMS_EACH]
    if in_time:  # the curve, which events start from
        kept = [s for s in best_of_form.values() if s.variant.effect.family.is_curve] or [score]
    jobs = []
    for s in kept:
        same = s.variant.effect.family.is_curve and s.variant.effect == fitted.score.variant.effect
        warm = None if in_time and not same else ended.fit
        fine = finer(s.variant, ended.effects[-1].coefficients if same else s.start)
        if fine:
            jobs.append(Job(fitted.linearisation, replace(s, variant=fine[0], start=fine[1]), warm))
        else:
            jobs.append(Job(fitted.linearisation, s, warm))
    if score.variant.effect.family.passes:
        jobs.append(Job(fitted.linearisation, score))
    return jobs


def _turns(score: Score) -> bool:
    """Whether a form turns with the sign of its driver."""
    return score.variant.effect.family.turns
