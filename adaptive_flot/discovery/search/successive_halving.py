"""Refit the best-scored candidates in two heats, each with its own noise model, and rank them.

First all of them in their best form with a few steps, then the finalists in several forms to the end; last, what only a
finished fit can start: events in time, and the constant that a dependence may have come to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.verification import worth_its_freedom
from adaptive_flot.discovery.candidates.direction import nameable
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.fitting.node_spacing import at_every_row
from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.search.alternatives import Alternative, effect_bounds, fit_variant, variant_model
from adaptive_flot.discovery.search.entrants import (
    Job,
    Lane,
    Run,
    best_of_each,
    constants,
    events,
    fewer_knots,
    first_forms,
    forms,
    from_scratch,
    is_curve,
    more_freedom,
    step,
    unbent,
)

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
    heats = _Heats(fitter, base, lanes, before, processes, done)
    first = heats.first()
    last = heats.last(first)
    followers = heats.followers(last)
    bent = heats.bent(followers, last)
    found = best_of_each([*heats.steps(followers, last), *bent, *followers, *last, *first])
    found = best_of_each([*heats.trimmed(found[:MOST_FREED]), *found])
    ranked = [run.alternative for run in best_of_each([*heats.freed(found, last), *found])]
    exact = [_exact(fitter, base, a) for a in ranked[:LEADERS]]
    return sorted([*exact, *ranked[LEADERS:]], key=lambda a: a.fit.bic)


class _Heats:
    """The heats of one refit, in their order; each takes what the earlier ones came to."""

    def __init__(
        self,
        fitter: Fitter,
        base: Fit,
        lanes: Sequence[Lane],
        before: Alternative | None,
        processes: int,
        done: Callable[[], None],
    ) -> None:
        self.fitter, self.base, self.before, self.processes, self.done = fitter, base, before, processes, done
        self.lanes = [replace(lane, scores=[lane.scorer.refined(s) for s in lane.scores]) for lane in lanes]
        time = fitter.problem.record.time
        self.low, self.high = float(time[0]), float(time[-1])

    def _run(self, jobs: list[Job], steps: int = MOST_STEPS) -> list[Run]:
        def work(k: int) -> Fit | None:
            job = jobs[k]
            return fit_variant(self.fitter, self._start(job.lane), job.score, steps, job.warm, job.drawn)

        fits = parallel_map(work, range(len(jobs)), self.processes, self.done)
        found = [
            Run(job.lane, job.score, _alternative(self.base, self._start(job.lane), job.score, fit, self.before))
            for job, fit in zip(jobs, fits, strict=True)
            if fit
        ]
        return sorted(found, key=lambda run: run.alternative.fit.bic)

    def _start(self, lane: int) -> Fit:
        return self.lanes[lane].scorer.fit

    def first(self) -> list[Run]:
        """Everyone, a few steps."""
        entries = [Job(i, f) for i, lane in enumerate(self.lanes) for s in lane.scores for f in first_forms(lane, s)]
        return self._run(entries, FIRST_STEPS)

    def last(self, first: list[Run]) -> list[Run]:
        """The finalists in several forms, to the end."""
        furthest: dict[tuple[str, str], Run] = {}
        for run in first:
            furthest.setdefault(run.score.candidate.name, run)
        tied = {s.candidate.name for lane in self.lanes for s in lane.scores if s.gain > TIED * lane.scores[0].gain}
        finalists = _finalists(self._start(0).loss, list(furthest.values()), tied)
        drawn = {(run.lane, run.score.candidate.name): run for run in reversed(first) if is_curve(run)}
        coarse = [drawn.get((run.lane, run.score.candidate.name), run) for run in finalists]
        return self._run([job for run in coarse for job in forms(self.lanes[run.lane], run)])

    def followers(self, last: list[Run]) -> list[Run]:
        """Constants and events, which only a finished fit can start."""
        jobs: list[Job] = []
        for i, lane in enumerate(self.lanes):
            own = [run.alternative for run in last if run.lane == i]
            jobs += (Job(i, s, warm) for s, warm in constants(lane.scorer, own))
            jobs += (Job(i, s) for s in events(lane.scores, _close(own)))
        return self._run(jobs)

    def bent(self, followers: list[Run], last: list[Run]) -> list[Run]:
        """Dependences that came to no more than the constant at their site, which they contain: again, from there."""
        ended = best_of_each(last)
        return self._run([job for run in followers for job in unbent(run, ended, self.lanes[run.lane].scorer)])

    def steps(self, followers: list[Run], last: list[Run]) -> list[Run]:
        """Steps, which are simulated at every row: only where an event near the best came to be as short as one."""
        most = max((run.alternative.gain for run in (*followers, *last)), default=0.0)
        near = [run for run in best_of_each(followers) if run.alternative.gain > CLOSE_GAIN * most]
        return self._run([job for run in near for job in step(run, self.high - self.low)])

    def freed(self, found: list[Run], last: list[Run]) -> list[Run]:
        """Courses in time with more freedom where that pays; whom a rough course is to tell apart must all have it."""
        freed = self._freer(found[:FREED], found, last)
        if freed:
            ended = {run.alternative.names for run in last}
            others = [run for run in found[FREED:MOST_FREED] if run.alternative.names in ended]
            freed += self._freer(others, found, last)
        return freed

    def trimmed(self, runs: list[Run]) -> list[Run]:
        """Curves without the knots that they do not need, so that no course loses for a freedom it did not use."""
        return self._run(self._fewer(runs))

    def _fewer(self, runs: list[Run]) -> list[Job]:
        most = max((run.alternative.gain for run in runs), default=0.0)
        near = [run for run in runs if run.alternative.gain > CLOSE_GAIN * most]
        count = self.fitter.problem.count(self.fitter.rows)
        return fewer_knots(near, float(np.log(max(count, 2))))

    def _freer(self, runs: list[Run], found: list[Run], last: list[Run]) -> list[Run]:
        names = {run.alternative.names for run in runs}
        curves = best_of_each([run for run in last if run.alternative.names in names and is_curve(run)])
        both = [*(run for run in runs if not is_curve(run)), *curves]
        free = self._run([job for run in both for job in more_freedom(run, self.low, self.high)])
        fewer = self._fewer(free)
        free += self._run([*fewer, *from_scratch(fewer)])
        bound = {run.alternative.names: run.alternative.fit for run in found}
        problem = self.fitter.problem
        return [r for r in free if worth_its_freedom(problem, bound[r.alternative.names], r.alternative.fit)]


def _close(found: list[Alternative]) -> list[Alternative]:
    """Alternatives that gained about as much as the best: what else is far behind it is not worth more forms."""
    most = max((a.gain for a in found), default=0.0)
    return [a for a in found if a.gain > CLOSE_GAIN * most]


def _exact(fitter: Fitter, base: Fit, a: Alternative) -> Alternative:
    """The alternative as a run at every row has it."""
    bounds = {k: b for e in a.effects for k, b in effect_bounds(fitter.problem, a.fit.model, e).items()}
    fit = at_every_row(fitter, a.fit, bounds)
    return replace(a, fit=fit, gain=base.loss - fit.loss, delta_bic=fit.bic - base.bic)


def _finalists(loss: float, ranked: list[Run], tied: set[tuple[str, str]]) -> list[Run]:
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


def _alternative(base: Fit, start: Fit, score: Score, found: Fit, before: Alternative | None) -> Alternative:
    fit = found.with_model(lambda: variant_model(start, score))
    return Alternative(
        (*(before.names if before else ()), score.candidate.name),
        (*(before.known if before else ()), nameable(fit.model, fit.model.fitted_effects()[-1], score.candidate.known)),
        fit,
        base.loss - fit.loss,
        fit.bic - base.bic,
    )
