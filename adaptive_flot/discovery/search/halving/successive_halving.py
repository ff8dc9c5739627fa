"""Successive halving: refit the best-scored candidates in two rungs, each with its own noise model, and rank them.

All candidates get a small budget (FIRST_STEPS), the best of them the whole one: Jamieson & Talwalkar, *Non-stochastic
best arm identification and hyperparameter optimization*, AISTATS (2016). Here with two rungs, and with as many in the
second as come near the best (`first_rungs.finalists`) instead of a half.

First all of them in their best form with a few steps, then the finalists in several forms to the end; last, what only a
finished fit can start: events in time, and the constant that a dependence may have come to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import at_every_row
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import effect_bounds
from adaptive_flot.discovery.search.halving import constants, events, first_rungs, freedom, late, restarts
from adaptive_flot.discovery.search.halving.first_rungs import NEAR_FINALIST
from adaptive_flot.discovery.search.halving.jobs import CLOSE_GAIN, ScoredLinearisation, best_of_each
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.rescaled import as_it_came, factors_of, rescaled
from adaptive_flot.parallel import parallel_map

LEADERS = 4
"""Alternatives that are run at every row in the end."""


def refit(
    fitter: Fitter,
    base: Fit,
    linearisations: Sequence[ScoredLinearisation],
    before: Alternative | None = None,
    processes: int = 1,
    done: Callable[[str], None] = lambda what: None,
    rival: Alternative | None = None,
) -> tuple[list[Alternative], bool]:
    """Fit each shortlisted candidate on top of `before` (the base model by default), best first; and whether all were.

    They were not where the time was up before every finalist had been fitted to the end.

    A candidate may start from several linearisations; only that in which it comes furthest in the first rung goes on.
    Where a `rival` of as many effects is known already, only those go on that come near it.
    """
    own = Refit(fitter, base, linearisations, before, processes, done)
    first = first_rungs.first(own)
    went_on = [fitted for fitted in first if own.keeps_up(fitted.alternative, rival, NEAR_FINALIST)]
    if not went_on:
        return [fitted.alternative for fitted in best_of_each(first)], not fitter.problem.time_is_up
    last = first_rungs.last(own, went_on)
    last += restarts.from_constants_of_the_best(own, last, first)
    last += restarts.astray(own, last, first)
    last += late.held(own, last)
    compared = not fitter.problem.time_is_up
    followers = events.followers(own, last)
    followers += events.ramps_and_washouts(own, followers)
    followers += events.lines(own, last)
    bent = restarts.bent(own, followers, last)
    best = best_of_each([*events.steps(own, followers, last), *bent, *followers, *last, *first])
    best = best_of_each([*events.slower(own, best), *best])
    best = best_of_each([*freedom.simpler(own, best, last), *best])
    best = best_of_each([*freedom.freed(own, best, last), *best])
    best = best_of_each([*constants.flat(own, best), *best])
    best = best_of_each([*restarts.same_event(own, best), *best])
    ranked = [fitted.alternative for fitted in best_of_each([*events.softer(own, best), *best])]
    done("the leaders at every row")
    leaders = [a for a in ranked[:LEADERS] if own.keeps_up(a, rival or ranked[0], CLOSE_GAIN)]
    exact = _all_exact(fitter, base, leaders, processes)
    return sorted([*exact, *(a for a in ranked if a not in leaders)], key=lambda a: a.fit.bic), compared


def _all_exact(fitter: Fitter, base: Fit, leaders: Sequence[Alternative], processes: int) -> list[Alternative]:
    """The leaders as runs at every row have them, and at their own constants where these are uncertain."""

    def exact(k: int) -> tuple[Fit, Mapping[str, float]]:
        a = leaders[k]
        bounds = {n: b for e in a.effects for n, b in effect_bounds(fitter.problem, a.fit.model, e).items()}
        fit = fitter.at_its_constants(at_every_row(fitter, a.fit, bounds), bounds)
        return fit, factors_of(fit.model)

    found = []
    for a, (fit, factors) in zip(leaders, parallel_map(exact, range(len(leaders)), processes), strict=True):
        own = a.fit.model

        def make(model: Model = own, factors: Mapping[str, float] = factors) -> Model:
            return rescaled(model, factors) if factors else as_it_came(model)

        fit = fit.with_model(make)
        found.append(replace(a, fit=fit, gain=base.loss - fit.loss, delta_bic=fit.bic - base.bic))
    return found
