"""Which fits a rung makes: forms, events, constants and freer profiles, each from what earlier rungs came to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import FINE_TIME_KNOTS, finer
from adaptive_flot.discovery.candidates.knots import trimmed
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.shapes.limited_lines import limited_lines
from adaptive_flot.discovery.candidates.shapes.step_events import event_scores, freer, slower_scores, step_score
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS, STATELESS_DRIVERS, Effect
from adaptive_flot.greybox.forms.form import CoefficientRole

FORMS_EACH = 3
MOST_CONSTANTS = 4
"""Alternatives whose sites are tried with a constant."""
MOST_PROFILES = 6
"""Curves in time that are tried as events."""
MOST_LINES = 3
"""Curves over a signal that are tried as a line with kinks."""
EDGE_ROWS = (3.0, 6.0, 12.0, 24.0)
"""Rows over which the edges of a pulse are rounded that are tried beside sharp ones."""
BENT = 0.3
"""A dependence is surely not flat when to flatten it costs this share of all it gained."""
NEARLY = 0.9
"""First-order gain of the constant, as a share of that of a dependence at its site, from which it is tried anyway."""
ADDS = 0.05
"""A dependence that adds less than this share to the gain of the constant at its site is fitted again from there."""


@dataclass(frozen=True)
class ScoredLinearisation:
    """Responses along one fit, from which the searches start, and the candidates that are worth one."""

    scorer: Scorer
    scores: list[Score]


@dataclass(frozen=True)
class Job:
    """A fit to be made in one linearisation, from scratch or from a fit of the same name."""

    linearisation: int
    score: Score
    warm: Fit | None = None
    drawn: bool = False
    """Whether the start values draw a curve that was fitted, and are no first-order estimate."""


@dataclass(frozen=True)
class FittedJob:
    """A job that was done: the alternative that it came to."""

    linearisation: int
    score: Score
    alternative: Alternative


def first_forms(linearisation: ScoredLinearisation, score: Score) -> list[Score]:
    """The forms of the first rung: the best one, for what depends on time its curve too, and what a switch replaced."""
    if score.variant.effect.family.memory:
        return [score, *linearisation.scorer.variant_scores(score.candidate)[:1]]
    if score.candidate.driver != "time":  # to first order a curve bends towards any turn
        return [score, *(s for s in linearisation.scorer.variant_scores(score.candidate) if _turns(s) and s != score)]
    curves = [s for s in linearisation.scorer.variant_scores(score.candidate) if s.variant.effect.family.is_curve][:1]
    return [score] if score.variant.effect.family.is_curve else [score, *curves]


def _turns(score: Score) -> bool:
    """Whether a form turns with the sign of its driver."""
    return score.variant.effect.family.turns


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


def constants(scorer: Scorer, ended: list[Alternative]) -> list[tuple[Score, Fit]]:
    """The constant change at the sites of the best fits, from what a dependence on a driver or on time came to.

    A dependence that turned out flat is that constant, which has the better name. And where the two are as good as the
    same to first order, the constant must have been fitted too before the record can prefer the dependence.
    """
    scores = {s.candidate.name: s.gain for s in scorer.scores()}
    at = {s.candidate.site.name: s for s in scorer.scores() if s.candidate.driver == "constant"}
    at_site: dict[str, tuple[Score, Fit]] = {}
    for a in ended[:MOST_CONSTANTS]:
        effect = a.effects[-1]
        site, levels = effect.site, effect.levels
        if effect.driver in ("constant", *DYNAMIC_DRIVERS) or site not in at or site in at_site or not levels:
            continue
        nearly = at[site].gain > NEARLY * scores.get((site, effect.driver), np.inf)
        if not nearly and (effect.driver == "time" or _bend(a.fit, effect) > BENT * max(a.gain, 0.0)):
            continue
        shifts = scorer.variant_scores(at[site].candidate)
        shift = next((v for v in shifts if v.variant.effect.mode == effect.mode), None)
        if shift is None:  # adapted parameters take it up
            continue
        at_site[site] = replace(shift, start={"amplitude": float(np.mean(levels))}), a.fit
    return list(at_site.values())


def unbent(constant: FittedJob, ended: list[FittedJob], scorer: Scorer) -> list[Job]:
    """Dependences that hardly gained more than a constant at the same site: fits to start from the constant.

    The constant is a special case of each, so that one which ends no better may have come to rest elsewhere. `scorer`
    tells the usual value at the site, by which an offset is a relative change.
    """
    effect, reached = constant.alternative.effects[-1], constant.alternative
    if effect.driver != "constant":
        return []
    jobs = []
    for fitted in ended:
        own = fitted.alternative.effects[-1]
        if own.site != effect.site or own.driver in STATELESS_DRIVERS:
            continue
        if fitted.alternative.gain < (1 + ADDS) * reached.gain:
            level = effect.coefficients["amplitude"] * scorer.in_mode(effect.site, effect.mode, own.mode)
            shape = dict(fitted.score.variant.start)
            start = {c.name: level if c.is_level else shape.get(c.name, 0.0) for c in own.terms}
            jobs.append(Job(constant.linearisation, replace(fitted.score, start=start), reached.fit))
    return jobs


def _bend(fit: Fit, effect: Effect) -> float:
    """How much minus two log-likelihood would rise if the dependence were flat, to second order.

    With the coefficients v that are zero where it is flat (of a curve, the differences of its values) and their
    covariance C: v' C^-1 v, Wald's statistic, *Trans. Am. Math. Soc.* 54 (1943) 426.
    """
    size = (CoefficientRole.LEVEL,) if effect.family.memory else (CoefficientRole.KNOT_VALUE, CoefficientRole.SLOPE)
    names = map(effect.parameter, effect.names(*size))
    where = [fit.names.index(n) for n in names if n in fit.names]
    values, covariance = fit.values[where], fit.covariance[np.ix_(where, where)]
    if effect.family.is_curve:
        difference = np.diff(np.eye(len(where)), axis=0)
        values, covariance = difference @ values, difference @ covariance @ difference.T
    return float(values @ np.linalg.pinv(covariance, hermitian=True) @ values)


def events(scores: list[Score], ended: list[Alternative]) -> list[Score]:
    """Events at the sites of fitted curves in time, started from the best curve of each."""
    by_name = {s.candidate.name: s for s in scores}
    by_candidate: dict[tuple[str, str], list[Score]] = {}
    for a in ended:
        effect, name = a.effects[-1], a.names[-1]
        wanted = effect.driver == "time" and effect.family.is_curve and name not in by_candidate
        if wanted and len(by_candidate) < MOST_PROFILES:
            by_candidate[name] = event_scores(by_name[name], effect)
    return [s for group in by_candidate.values() for s in group]


def lines(runs: list[FittedJob], scorers: Sequence[Scorer]) -> list[Job]:
    """Lines with kinks in place of the best curves over a signal; `scorers` tell what each signal has seen."""
    curves = [f for f in runs if is_curve(f) and f.alternative.effects[-1].driver not in STATELESS_DRIVERS]
    jobs = []
    for f in curves[:MOST_LINES]:
        effect = f.alternative.effects[-1]
        seen = scorers[f.linearisation].drivers[effect.driver]
        jobs += [Job(f.linearisation, s, f.alternative.fit, drawn=True) for s in limited_lines(f.score, effect, seen)]
    return jobs


def step(fitted: FittedJob, span: float) -> list[Job]:
    """A step where a fitted event is over at once; `span` is the length of the record [s]."""
    score = step_score(fitted.score, fitted.alternative.effects[-1], span)
    return [Job(fitted.linearisation, score)] if score else []


def slower(fitted: FittedJob, span: float) -> list[Job]:
    """A ramp and a washout around a fitted step, where that is what was fitted; `span` is that of the record [s]."""
    around = slower_scores(fitted.score, fitted.alternative.effects[-1], span)
    return [Job(fitted.linearisation, s, fitted.alternative.fit, drawn=True) for s in around]


def as_event_of(fitted: FittedJob, leader: FittedJob) -> list[Job]:
    """A change in time at one site, as the event of another one: its form, times and constants, and no size yet."""
    own, event = fitted.alternative.effects[-1], leader.alternative.effects[-1]
    if own.driver != "time" or own.site == event.site:
        return []
    effect = replace(event, site=own.site, mode=own.mode, coefficients={})
    shape = {c.name: event.coefficients[c.name] for c in event.terms if c.is_shape}
    start = {c.name: 0.0 for c in event.terms if not c.is_shape} | shape
    variant = Variant(effect, (), tuple(n for n in start if n not in shape), tuple(shape.items()))
    return [
        Job(fitted.linearisation, replace(fitted.score, variant=variant, start=start), leader.alternative.fit, True)
    ]


def softer(fitted: FittedJob, dt: float) -> list[Job]:
    """A fitted pulse with edges over EDGE_ROWS rows, from where it stands; nothing for other forms."""
    effect = fitted.alternative.effects[-1]
    if not effect.family.passes:
        return []
    start = {c.name: effect.coefficients[c.name] for c in effect.terms}
    shape = tuple((c.name, start[c.name]) for c in effect.terms if c.is_shape)
    jobs = []
    for rows in EDGE_ROWS:
        soft = replace(effect, coefficients={}, settings={**effect.settings, "width": rows * dt})
        variant = Variant(soft, (), tuple(n for n in start if n not in dict(shape)), shape)
        score = replace(fitted.score, variant=variant, start=start)
        jobs.append(Job(fitted.linearisation, score, fitted.alternative.fit, drawn=True))
    return jobs


def more_freedom(fitted: FittedJob, low: float, high: float) -> list[Job]:
    """The same time profile with more freedom, where a curve or a smooth event was the best of its name."""
    effect = fitted.alternative.effects[-1]
    freed = freer(effect, low, high) if effect.driver == "time" else None
    if freed is None:
        return []
    variant, start = freed
    return [
        Job(
            fitted.linearisation,
            replace(fitted.score, variant=variant, start=start),
            fitted.alternative.fit,
            drawn=True,
        )
    ]


def fewer_knots(runs: list[FittedJob], price: float) -> list[Job]:
    """For each name the curve that should come out best without the knots that it does not need, from its fit."""
    best: dict[tuple[tuple[str, str], ...], tuple[float, Job]] = {}
    for fitted in runs:
        a = fitted.alternative
        less = trimmed(a.fit, a.effects[-1], price)
        if less is None:
            continue
        promised = a.fit.bic - less.gain
        if a.names not in best or promised < best[a.names][0]:
            score = replace(fitted.score, variant=less.variant, start=less.start)
            best[a.names] = promised, Job(fitted.linearisation, score, a.fit, drawn=True)
    return [job for _, job in best.values()]


def from_scratch(jobs: list[Job]) -> list[Job]:
    """The same curves from nothing: a rough one may have led the initial state astray, and each finer one with it."""
    short = [job for job in jobs if len(job.score.start) <= FINE_TIME_KNOTS]
    return [replace(j, score=replace(j.score, start=dict.fromkeys(j.score.start, 0.0)), warm=None) for j in short]


def flattened(fitted: FittedJob, warm: Fit) -> Job:
    """A curve with as many knots as that of a finalist, from zero, at the constants of another fit."""
    none = dict.fromkeys(fitted.score.start, 0.0)
    fine = finer(fitted.score.variant, none)
    variant, start = fine if fine else (fitted.score.variant, none)
    return Job(fitted.linearisation, replace(fitted.score, variant=variant, start=start), warm, drawn=True)


def is_curve(fitted: FittedJob) -> bool:
    """Whether the form that was fitted is a free curve."""
    return fitted.score.variant.effect.family.is_curve


def best_of_each(jobs: list[FittedJob]) -> list[FittedJob]:
    """The best fit of each name, best first."""
    best: dict[tuple[tuple[str, str], ...], FittedJob] = {}
    for fitted in sorted(jobs, key=lambda fitted: fitted.alternative.fit.bic):
        best.setdefault(fitted.alternative.names, fitted)
    return list(best.values())
