"""Constant changes at the sites of fitted dependences: a dependence that turned out flat has the better name as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, is_constant
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS, Effect
from adaptive_flot.greybox.forms.form import CoefficientRole

MOST_CONSTANTS = 4
"""Alternatives whose sites are tried with a constant."""
BENT = 0.3
"""A dependence is surely not flat when to flatten it costs this share of all it gained."""
STAYS = 0.25
"""A curve in time that moves by less than this share of its mean is tried as a constant."""
NEARLY = 0.9
"""First-order gain of the constant, as a share of that of a dependence at its site, from which it is tried anyway."""


def flat(refit: Refit, best: list[FittedJob]) -> list[FittedJob]:
    """Constants at the sites of the leaders once more, from where these have ended in the meantime.

    A constant may have rested where the others were then; a curve that is flat by now is better only for its start. And
    it may be flat only by now.
    """
    reached = {f.alternative.effects[-1].site: f.alternative for f in best if is_constant(f)}
    jobs: list[Job] = []
    for i, linearisation in enumerate(refit.linearisations):
        own = [f.alternative for f in best[:MOST_CONSTANTS] if f.linearisation == i]
        ahead = [a for a in own if _is_ahead(a, reached.get(a.names[-1][0]))]
        jobs += (Job(i, s, warm) for s, warm in constants(linearisation.scorer, ahead))
    return refit.run(jobs)


def _is_ahead(a: Alternative, constant: Alternative | None) -> bool:
    """Whether an alternative gained more than the constant at its site; without one, whether it may be that."""
    return _stays(a.effects[-1]) if constant is None else a.gain > constant.gain


def constants(scorer: Scorer, ended: list[Alternative]) -> list[tuple[Score, Fit]]:
    """The constant change at the sites of the best fits, from what a dependence on a driver or on time came to.

    A dependence that turned out flat is that constant, which has the better name. And where the two are as good as the
    same to first order, or a curve in time is a level more than a change, the constant must have been fitted too before
    the record can prefer the dependence.
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
        if not (nearly or _stays(effect)) and (
            effect.driver == "time" or _bend(a.fit, effect) > BENT * max(a.gain, 0.0)
        ):
            continue
        shifts = scorer.variant_scores(at[site].candidate)
        shift = next((v for v in shifts if v.variant.effect.mode == effect.mode), None)
        if shift is None:  # adapted parameters take it up
            continue
        at_site[site] = replace(shift, start={"amplitude": float(np.mean(levels))}), a.fit
    return list(at_site.values())


def _stays(effect: Effect) -> bool:
    """Whether a curve in time is a level much more than a change: it moves by a small share of its own mean."""
    values = np.array(effect.levels)
    in_time = effect.driver == "time" and effect.family.is_curve
    return in_time and bool(np.ptp(values) < STAYS * abs(np.mean(values)))


def _bend(fit: Fit, effect: Effect) -> float:
    """How much minus two log-likelihood would rise if the dependence were flat, to second order.

    With the coefficients v that are zero where it is flat (of values or levels, their differences) and their
    covariance C: v' C^-1 v, Wald's statistic, *Trans. Am. Math. Soc.* 54 (1943) 426.
    """
    size = (CoefficientRole.LEVEL,) if effect.family.memory else (CoefficientRole.KNOT_VALUE, CoefficientRole.SLOPE)
    names = map(effect.parameter, effect.names(*size))
    where = [fit.names.index(n) for n in names if n in fit.names]
    values, covariance = fit.values[where], fit.covariance[np.ix_(where, where)]
    if effect.family.is_curve or (effect.family.memory and len(where) > 1):
        difference = np.diff(np.eye(len(where)), axis=0)
        values, covariance = difference @ values, difference @ covariance @ difference.T
    return float(values @ np.linalg.pinv(covariance, hermitian=True) @ values)
