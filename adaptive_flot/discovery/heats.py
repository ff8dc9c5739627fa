"""Refit the best-scored candidates in two heats, each with its own noise model, and rank them.

First all of them in their best form with a few steps, then the finalists in several forms to the end; last, what only a
finished fit can start: events in time, and the constant that a dependence may have come to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.attribute import Alternative, effect_bounds, fit_variant, fixed_coefficients
from adaptive_flot.discovery.catalogue import finer
from adaptive_flot.discovery.direction import nameable
from adaptive_flot.discovery.events import event_scores, freer, step_score
from adaptive_flot.discovery.fit import Fit
from adaptive_flot.discovery.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.pace import at_every_row
from adaptive_flot.discovery.parallel import parallel_map
from adaptive_flot.discovery.scoring import Score, Scorer
from adaptive_flot.discovery.verify import worth_its_freedom
from adaptive_flot.greybox.effects import STATELESS_DRIVERS, Effect

FORMS_EACH = 3
FIRST_STEPS = 6
"""Steps of the first heat, in which every candidate runs."""
FINALISTS = 4
SURE_FINALISTS = 3
NEAR_FINALIST = 0.5
"""A finalist beyond the third must have gained at least this share of what the first gained ..."""
TIED, MOST_FINALISTS = 0.95, 7
"""... or have this share of the best first-order gain, in which several may tie."""
LEADERS = 4
"""Alternatives that are run at every row in the end."""
CLOSE_GAIN = 0.7
"""Share of the best gain from which a curve in time is tried as an event as well."""
FREED, MOST_FREED = 2, 8
"""Names whose course in time gets more freedom in the end; further ones where that was worth its price to the first."""
BENT = 0.3
"""A dependence is surely not flat when to flatten it costs this share of all it gained."""


@dataclass(frozen=True)
class Lane:
    """A linearisation, whose fit the searches start from, and the candidates that are worth one."""

    scorer: Scorer
    scores: list[Score]


@dataclass(frozen=True)
class _Job:
    """A fit to be made in one lane, from scratch or from a fit of the same name."""

    lane: int
    score: Score
    warm: Fit | None = None


@dataclass(frozen=True)
class _Run:
    """A fit in one lane."""

    lane: int
    score: Score
    alternative: Alternative


def refit(
    fitter: Fitter,
    base: Fit,
    lanes: Sequence[Lane],
    before: Alternative | None = None,
    processes: int = 1,
    done: Callable[[], None] = lambda: None,
) -> list[Alternative]:
    """Fit each shortlisted candidate on top of `before` (the base model by default), best first.

    A candidate may start in several lanes; only the lane in which it comes furthest in the first heat goes on.
    """
    lanes = [replace(lane, scores=[lane.scorer.refined(s) for s in lane.scores]) for lane in lanes]

    def heat(jobs: list[_Job], steps: int) -> list[_Run]:
        def work(k: int) -> Fit | None:
            job = jobs[k]
            fit = fit_variant(fitter, lanes[job.lane].scorer.fit, job.score, steps, job.warm)
            return replace(fit, model=None) if fit else None  # type: ignore[arg-type]  # a model does not pickle

        fits = parallel_map(work, range(len(jobs)), processes, done)
        found = [
            _Run(job.lane, job.score, _alternative(base, lanes[job.lane].scorer.fit, job.score, fit, before))
            for job, fit in zip(jobs, fits, strict=True)
            if fit
        ]
        return sorted(found, key=lambda run: run.alternative.fit.bic)

    first = heat(
        [_Job(i, f) for i, lane in enumerate(lanes) for s in lane.scores for f in _first_forms(lane, s)], FIRST_STEPS
    )
    furthest: dict[tuple[str, str], _Run] = {}
    for run in first:
        furthest.setdefault(run.score.candidate.name, run)
    tied = {s.candidate.name for lane in lanes for s in lane.scores if s.gain > TIED * lane.scores[0].gain}
    finalists = _finalists(lanes[0].scorer.fit.loss, list(furthest.values()), tied)
    drawn = {(run.lane, run.score.candidate.name): run for run in reversed(first) if _is_curve(run)}
    last = heat(
        [
            job
            for run in finalists
            for job in _forms(lanes[run.lane], drawn.get((run.lane, run.score.candidate.name), run))
        ],
        MOST_STEPS,
    )
    followers: list[_Job] = []
    for i, lane in enumerate(lanes):
        own = [run.alternative for run in last if run.lane == i]
        followers += (_Job(i, s, warm) for s, warm in _constants(lane.scorer, own))
        followers += (_Job(i, s) for s in _events(lane.scores, _close(own)))
    events = heat(followers, MOST_STEPS)
    # a step is simulated at every row, which costs: only where the ramp or washout came to be as short as one
    time = fitter.problem.record.time
    low, high = float(time[0]), float(time[-1])
    most = max((run.alternative.gain for run in (*events, *last)), default=0.0)
    steps = [
        _Job(run.lane, s)
        for run in _best_of_each(events)
        if run.alternative.gain > CLOSE_GAIN * most
        and (s := step_score(run.score, run.alternative.effects[-1], high - low))
    ]
    found = _best_of_each([*heat(steps, MOST_STEPS), *events, *last, *first])
    bound = {run.alternative.names: run.alternative.fit for run in found}

    def worth(runs: list[_Run]) -> list[_Run]:
        names = {run.alternative.names for run in runs}
        curves = _best_of_each([run for run in last if run.alternative.names in names and _is_curve(run)])
        both = [*runs, *(c for c in curves if not any(c is run for run in runs))]
        free = heat([job for run in both for job in _freer(run, low, high)], MOST_STEPS)
        return [r for r in free if worth_its_freedom(fitter.problem, bound[r.alternative.names], r.alternative.fit)]

    freed = worth(found[:FREED])
    if freed:  # the course is a rough one: who is told apart by it must all be able to follow it
        ended = {run.alternative.names for run in last}
        freed += worth([run for run in found[FREED:MOST_FREED] if run.alternative.names in ended])
    ranked = [run.alternative for run in _best_of_each([*freed, *found])]
    exact = [_exact(fitter, base, a) for a in ranked[:LEADERS]]
    return sorted([*exact, *ranked[LEADERS:]], key=lambda a: a.fit.bic)


def _close(found: list[Alternative]) -> list[Alternative]:
    """Alternatives that gained about as much as the best: what else is far behind it is not worth more forms."""
    most = max((a.gain for a in found), default=0.0)
    return [a for a in found if a.gain > CLOSE_GAIN * most]


def _exact(fitter: Fitter, base: Fit, a: Alternative) -> Alternative:
    """The alternative as a run at every row has it."""
    bounds = {k: b for e in a.effects for k, b in effect_bounds(fitter.problem, a.fit.model, e).items()}
    fit = at_every_row(fitter, a.fit, bounds)
    return replace(a, fit=fit, gain=base.loss - fit.loss, delta_bic=fit.bic - base.bic)


def _finalists(loss: float, ranked: list[_Run], tied: set[tuple[str, str]]) -> list[_Run]:
    """Who goes on: the first few, more that come near them or tie with them to first order (few steps tell little).

    `loss` is that of the model as it is.
    """
    gains = [max(loss - run.alternative.fit.loss, 0.0) for run in ranked]
    chosen = [
        run
        for i, (run, gain) in enumerate(zip(ranked, gains, strict=True))
        if i < SURE_FINALISTS or (i < FINALISTS and gain > NEAR_FINALIST * gains[0]) or run.score.candidate.name in tied
    ]
    return chosen[:MOST_FINALISTS]


def _best_of_each(found: list[_Run]) -> list[_Run]:
    """The best fit of each name, best first."""
    best: dict[tuple[tuple[str, str], ...], _Run] = {}
    for run in sorted(found, key=lambda run: run.alternative.fit.bic):
        best.setdefault(run.alternative.names, run)
    return list(best.values())


def _is_curve(run: _Run) -> bool:
    return run.score.variant.effect.form == "curve"


def _freer(run: _Run, low: float, high: float) -> list[_Job]:
    """The same course in time with more freedom, where a curve or a smooth event was the best of its name."""
    effect = run.alternative.effects[-1]
    found = freer(effect, low, high) if effect.driver == "time" else None
    if found is None:
        return []
    variant, start = found
    return [_Job(run.lane, replace(run.score, variant=variant, start=start), run.alternative.fit)]


def _alternative(base: Fit, start: Fit, score: Score, bare: Fit, before: Alternative | None) -> Alternative:
    model = start.model.with_effects([score.variant.effect])
    held = {score.variant.effect.parameter(k): v for k, v in fixed_coefficients(score.variant.effect).items()}
    values = dict(zip(bare.names, map(float, bare.values), strict=True))
    fit = replace(bare, model=model.with_parameters({**held, **values}))
    return Alternative(
        (*(before.names if before else ()), score.candidate.name),
        (*(before.known if before else ()), nameable(fit.model, fit.model.fitted_effects()[-1], score.candidate.known)),
        fit,
        base.loss - fit.loss,
        fit.bic - base.bic,
    )


def _constants(scorer: Scorer, fitted: list[Alternative]) -> list[tuple[Score, Fit]]:
    """The constant change at the sites of the best fits, from what a dependence on a driver came to.

    A dependence that turned out flat is that constant, which has the better name.
    """
    at = {s.candidate.site.name: s for s in scorer.scores() if s.candidate.driver == "constant"}
    found: dict[str, tuple[Score, Fit]] = {}
    for a in fitted[:FINALISTS]:
        effect = a.effects[-1]
        site, c = effect.site, effect.coefficients
        values = [v for k, v in c.items() if k.startswith(("value", "amplitude"))]
        if effect.driver in STATELESS_DRIVERS or site not in at or site in found or not values:
            continue
        if _bend(a.fit, effect) > BENT * max(a.gain, 0.0):
            continue
        shift = next(v for v in scorer.variant_scores(at[site].candidate) if v.variant.effect.mode == effect.mode)
        found[site] = replace(shift, start={"amplitude": float(np.mean(values))}), a.fit
    return list(found.values())


def _bend(fit: Fit, effect: Effect) -> float:
    """How much minus two log-likelihood would rise if the dependence were flat, to second order (Wald's test)."""
    names = [effect.parameter(c) for c in effect.coefficients if c.startswith("value") or c in ("exponent", "slope")]
    where = [fit.names.index(n) for n in names if n in fit.names]
    values, covariance = fit.values[where], fit.covariance[np.ix_(where, where)]
    if effect.form == "curve":
        difference = np.diff(np.eye(len(where)), axis=0)
        values, covariance = difference @ values, difference @ covariance @ difference.T
    return float(values @ np.linalg.pinv(covariance, hermitian=True) @ values)


def _forms(lane: Lane, run: _Run) -> list[_Job]:
    """Best variant of each form (and mode) of a candidate that comes near the best, from where the first heat ended."""
    name, fitted = run.score.candidate.name, run.alternative
    score = next(s for s in lane.scores if s.candidate.name == name)
    found: dict[tuple[str, str | None], Score] = {}
    for s in lane.scorer.variant_scores(score.candidate):
        key = s.variant.effect.form, s.variant.effect.mode
        if key not in found and s.gain > 0.5 * score.gain:
            found[key] = s
    in_time = score.candidate.driver == "time"
    kept = list(found.values())[:FORMS_EACH]
    if in_time:  # the curve, which events start from
        kept = [s for k, s in found.items() if k[0] == "curve"] or [score]
    jobs = []
    for s in kept:
        same = s.variant.effect.form == "curve" and s.variant.effect == run.score.variant.effect
        warm = None if in_time and not same else fitted.fit
        fine = finer(s.variant, fitted.effects[-1].coefficients if same else s.start)
        if fine:
            jobs.append(_Job(run.lane, replace(s, variant=fine[0], start=fine[1]), warm))
        else:
            jobs.append(_Job(run.lane, s, warm))
    return jobs


def _first_forms(lane: Lane, score: Score) -> list[Score]:
    """The forms of the first heat: the best one, and for what depends on time its curve too."""
    if score.candidate.driver != "time":
        return [score]
    curves = [s for s in lane.scorer.variant_scores(score.candidate) if s.variant.effect.form == "curve"][:1]
    return [score] if score.variant.effect.form == "curve" else [score, *curves]


def _events(scores: list[Score], fitted: list[Alternative]) -> list[Score]:
    """Events at the sites of fitted curves in time, started from the best curve of each."""
    by_name = {s.candidate.name: s for s in scores}
    found: dict[tuple[str, str], list[Score]] = {}
    for a in fitted:
        effect, name = a.effects[-1], a.names[-1]
        wanted = effect.driver == "time" and effect.form == "curve" and name not in found
        if wanted and len(found) < SURE_FINALISTS:
            found[name] = event_scores(by_name[name], effect)
    return [s for group in found.values() for s in group]
