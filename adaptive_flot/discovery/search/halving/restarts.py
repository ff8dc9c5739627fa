"""Fits that rested in a wrong place, once more from what another one came to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import finer
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.search.halving.first_rungs import NEAR_FINALIST
from adaptive_flot.discovery.search.halving.jobs import CLOSE_GAIN, FittedJob, Job, best_of_each, is_curve
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.greybox.effects import STATELESS_DRIVERS
from adaptive_flot.greybox.model import FloatArray

FAR_APART = 3.0
"""Factor between a constant of a finalist and that of the best one from which it is fitted from there as well."""
ADDS = 0.05
"""A dependence that adds less than this share to the gain of the constant at its site is fitted again from there."""
MOST_RIVALS = 8
"""Names, the best first, that are tried as the event of the best one."""


def from_constants_of_the_best(refit: Refit, last: list[FittedJob], first: list[FittedJob]) -> list[FittedJob]:
    """Whoever ended with constants far from those of the best one: once more, from there.

    Where much is missing, constants of the model as it is may be absurd, and a fit that starts there may stay.
    """
    if not last:
        return []
    best = min(last, key=lambda fitted: fitted.alternative.fit.bic).alternative.fit

    def constants(fit: Fit) -> FloatArray:
        return np.abs([dict(zip(fit.names, fit.values, strict=True))[n] for n in refit.fitter.problem.adapted])

    there = constants(best)

    def far(fit: Fit) -> bool:
        own = constants(fit)
        return bool(np.any(np.maximum(own, there) > FAR_APART * np.minimum(own, there)))

    return refit.run(
        [Job(f.linearisation, f.score, best) for f in best_of_each([*last, *first]) if far(f.alternative.fit)]
    )


def astray(refit: Refit, last: list[FittedJob], first: list[FittedJob]) -> list[FittedJob]:
    """Curves that promised as much as the best and came to far less: from nothing, at its constants."""
    ended = best_of_each([*last, *first])
    return refit.run(_gone_astray(refit, ended, first, ended[0].alternative.fit)) if ended else []


def _gone_astray(refit: Refit, ended: list[FittedJob], first: list[FittedJob], best: Fit) -> list[Job]:
    """Jobs for these: along the plain fit constants were far off, and a first-order curve has the wrong size."""
    most = max(fitted.alternative.gain for fitted in ended)
    tied = refit.tied()
    astray = {
        f.score.candidate.name
        for f in ended
        if f.score.candidate.name in tied and f.alternative.gain < NEAR_FINALIST * most
    }
    drawn = {f.score.candidate.name: f for f in reversed(first) if is_curve(f)}
    return [flattened(drawn[name], best) for name in sorted(astray & set(drawn))]


def flattened(fitted: FittedJob, warm: Fit) -> Job:
    """A curve with as many knots as that of a finalist, from zero, at the constants of another fit."""
    none = dict.fromkeys(fitted.score.start, 0.0)
    fine = finer(fitted.score.variant, none)
    variant, start = fine if fine else (fitted.score.variant, none)
    return Job(fitted.linearisation, replace(fitted.score, variant=variant, start=start), warm, drawn=True)


def bent(refit: Refit, followers: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
    """Dependences that came to no more than the constant at their site, which they contain: again, from there."""
    ended = best_of_each(last)
    return refit.run([job for f in followers for job in unbent(f, ended, refit.linearisations[f.linearisation].scorer)])


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


def same_event(refit: Refit, best: list[FittedJob]) -> list[FittedJob]:
    """Where the best one is an event: those near it at other sites as the same event, at its times and constants.

    An event has many local optima. One that happens to be found at the wrong site would outdo the cause.
    """
    leader = best[0]
    if not leader.alternative.effects[-1].family.is_event:
        return []
    near = [f for f in best[1:MOST_RIVALS] if f.alternative.gain > CLOSE_GAIN * leader.alternative.gain]
    return refit.run([job for f in near for job in as_event_of(f, leader)])


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
