"""The rungs of a refit: what each fits, from what the earlier ones came to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from adaptive_flot.discovery.assessment.likelihood import worth_its_freedom
from adaptive_flot.discovery.candidates.direction import nameable
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.shapes.relays import moves_often
from adaptive_flot.discovery.candidates.shapes.step_events import refined
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import fit_variant, variant_model
from adaptive_flot.discovery.search.halving.fit_jobs import (
    FittedJob,
    Job,
    ScoredLinearisation,
    as_event_of,
    best_of_each,
    constants,
    events,
    fewer_knots,
    first_forms,
    flattened,
    forms,
    from_scratch,
    is_curve,
    lines,
    more_freedom,
    slower,
    softer,
    step,
    unbent,
)
from adaptive_flot.greybox.model import FloatArray

FIRST_STEPS = 6
"""Steps of the first rung, in which every candidate takes part."""
FINALISTS = 4
SURE_FINALISTS = 3
NEAR_FINALIST = 0.5
"""A finalist beyond the third must have gained at least this share of what the first gained ..."""
TIED, MOST_FINALISTS = 0.95, 7
"""... or have this share of the best first-order gain, in which several may tie."""
FAR_APART = 3.0
"""Factor between a constant of a finalist and that of the best one from which it is fitted from there as well."""
LEADERS = 4
"""Alternatives that are run at every row in the end."""
CLOSE_GAIN = 0.7
"""Share of the best gain from which a curve in time is tried as an event as well."""
FREED, MOST_FREED = 2, 8
"""Names whose time profile gets more freedom in the end; further ones where that was worth its price to the first."""


class Rungs:
    """The rungs of one refit, in their order; each takes what the earlier ones came to."""

    def __init__(
        self,
        fitter: Fitter,
        base: Fit,
        linearisations: Sequence[ScoredLinearisation],
        before: Alternative | None,
        processes: int,
        done: Callable[[str], None],
    ) -> None:
        self.fitter, self.base, self.before, self.processes, self.done = fitter, base, before, processes, done
        self.linearisations = [
            replace(linearisation, scores=[refined(linearisation.scorer, s) for s in linearisation.scores])
            for linearisation in linearisations
        ]
        time = fitter.problem.record.time
        self.low, self.high = float(time[0]), float(time[-1])

    def _run(self, jobs: list[Job], steps: int = MOST_STEPS) -> list[FittedJob]:
        def work(k: int) -> Fit | None:
            job = jobs[k]
            if self.fitter.problem.time_is_up:
                return None
            return fit_variant(self.fitter, self._start(job.linearisation), job.score, steps, job.warm, job.drawn)

        ended = count(1)

        def tell() -> None:
            self.done(f"{next(ended)} of {len(jobs)}: {_words(jobs)}")

        fits = parallel_map(work, range(len(jobs)), self.processes, tell)
        done = [
            FittedJob(
                job.linearisation,
                job.score,
                _alternative(self.base, self._start(job.linearisation), job.score, fit, self.before),
            )
            for job, fit in zip(jobs, fits, strict=True)
            if fit
        ]
        done = [f for f in done if moves_often(self.fitter.problem, f.alternative.fit, f.alternative.effects[-1])]
        return sorted(done, key=lambda fitted: fitted.alternative.fit.bic)

    def keeps_up(self, a: Alternative, rival: Alternative | None, share: float) -> bool:
        """Whether an alternative gained at least a share of what a rival did, over what both stand on."""
        if rival is None:
            return True
        begun = self.before.gain if self.before else 0.0
        return a.gain - begun >= share * (rival.gain - begun)

    def _start(self, linearisation: int) -> Fit:
        return self.linearisations[linearisation].scorer.fit

    def first(self) -> list[FittedJob]:
        """Everyone, a few steps."""
        entries = [
            Job(i, f)
            for i, linearisation in enumerate(self.linearisations)
            for s in linearisation.scores
            for f in first_forms(linearisation, s)
        ]
        return self._run(entries, FIRST_STEPS)

    def last(self, first: list[FittedJob]) -> list[FittedJob]:
        """The finalists in several forms, to the end."""
        furthest: dict[tuple[str, str], FittedJob] = {}
        for fitted in first:
            furthest.setdefault(fitted.score.candidate.name, fitted)
        chosen = finalists(self._start(0).loss, list(furthest.values()), self._tied())
        drawn = {(f.linearisation, f.score.candidate.name): f for f in reversed(first) if is_curve(f)}
        coarse = [drawn.get((f.linearisation, f.score.candidate.name), f) for f in chosen]
        jobs = [job for f in coarse for job in forms(self.linearisations[f.linearisation], f)]
        return self._run([*jobs, *self._switches({f.score.candidate.name for f in chosen})])

    def from_constants_of_the_best(self, last: list[FittedJob], first: list[FittedJob]) -> list[FittedJob]:
        """Whoever ended with constants far from those of the best one: once more, from there.

        Where much is missing, constants of the model as it is may be absurd, and a fit that starts there may stay.
        """
        if not last:
            return []
        best = min(last, key=lambda fitted: fitted.alternative.fit.bic).alternative.fit

        def constants(fit: Fit) -> FloatArray:
            return np.abs([dict(zip(fit.names, fit.values, strict=True))[n] for n in self.fitter.problem.adapted])

        there = constants(best)

        def far(fit: Fit) -> bool:
            own = constants(fit)
            return bool(np.any(np.maximum(own, there) > FAR_APART * np.minimum(own, there)))

        return self._run(
            [Job(f.linearisation, f.score, best) for f in best_of_each([*last, *first]) if far(f.alternative.fit)]
        )

    def astray(self, last: list[FittedJob], first: list[FittedJob]) -> list[FittedJob]:
        """Curves that promised as much as the best and came to far less: from nothing, at its constants."""
        ended = best_of_each([*last, *first])
        return self._run(self._gone_astray(ended, first, ended[0].alternative.fit)) if ended else []

    def _gone_astray(self, ended: list[FittedJob], first: list[FittedJob], best: Fit) -> list[Job]:
        """Jobs for these: along the plain fit constants were far off, and a first-order curve has the wrong size."""
        most = max(fitted.alternative.gain for fitted in ended)
        tied = self._tied()
        astray = {
            f.score.candidate.name
            for f in ended
            if f.score.candidate.name in tied and f.alternative.gain < NEAR_FINALIST * most
        }
        drawn = {f.score.candidate.name: f for f in reversed(first) if is_curve(f)}
        return [flattened(drawn[name], best) for name in sorted(astray & set(drawn))]

    def _tied(self) -> set[tuple[str, str]]:
        """Names that explain about as much as the best one to first order."""
        return {
            s.candidate.name
            for linearisation in self.linearisations
            for s in linearisation.scores
            if s.gain > TIED * linearisation.scores[0].gain
        }

    def _switches(self, names: set[tuple[str, str]]) -> list[Job]:
        """Switches by a signal of these names, from each linearisation that proposes one.

        A few steps tell little of them: the name may have come further as a curve, along another linearisation.
        """
        return [
            Job(i, s)
            for i, linearisation in enumerate(self.linearisations)
            for s in linearisation.scores
            if s.candidate.name in names and s.variant.effect.family.memory
        ]

    def followers(self, last: list[FittedJob]) -> list[FittedJob]:
        """Constants and events, which only a finished fit can start."""
        jobs: list[Job] = []
        for i, linearisation in enumerate(self.linearisations):
            own = [fitted.alternative for fitted in last if fitted.linearisation == i]
            jobs += (Job(i, s, warm) for s, warm in constants(linearisation.scorer, own))
            jobs += (Job(i, s) for s in events(linearisation.scores, _close(own)))
        return self._run(jobs)

    def lines(self, last: list[FittedJob]) -> list[FittedJob]:
        """Lines with kinks, which start from a fitted curve over a signal."""
        most = max((fitted.alternative.gain for fitted in last), default=0.0)
        near = [fitted for fitted in last if fitted.alternative.gain > CLOSE_GAIN * most]
        return self._run(lines(best_of_each(near), [each.scorer for each in self.linearisations]))

    def slower(self, best: list[FittedJob]) -> list[FittedJob]:
        """Events that take their time, where a step is the best of a name: its curve may have been far too coarse."""
        most = max((fitted.alternative.gain for fitted in best), default=0.0)
        near = [fitted for fitted in best if fitted.alternative.gain > CLOSE_GAIN * most]
        return self._run([job for fitted in near for job in slower(fitted, self.high - self.low)])

    def same_event(self, best: list[FittedJob]) -> list[FittedJob]:
        """Where the best one is an event: those near it at other sites as the same event, at its times and constants.

        An event has many local optima. One that happens to be found at the wrong site would outdo the cause.
        """
        leader = best[0]
        if not leader.alternative.effects[-1].family.is_event:
            return []
        near = [f for f in best[1:MOST_FREED] if f.alternative.gain > CLOSE_GAIN * leader.alternative.gain]
        return self._run([job for f in near for job in as_event_of(f, leader)])

    def softer(self, best: list[FittedJob]) -> list[FittedJob]:
        """Pulses with edges that take longer: else the site is told by how sharp its outputs' edges are."""
        near = [f for f in best[:MOST_FREED] if f.alternative.gain > CLOSE_GAIN * best[0].alternative.gain]
        return self._run([job for f in near for job in softer(f, self.fitter.problem.record.dt)])

    def flat(self, best: list[FittedJob]) -> list[FittedJob]:
        """Constants at the sites of the leaders once more, from where these have ended in the meantime.

        A constant may have rested where the others were then; a curve that is flat by now is better only for its start.
        """
        reached = {f.alternative.effects[-1].site: f.alternative for f in best if _is_constant(f)}
        jobs: list[Job] = []
        for i, linearisation in enumerate(self.linearisations):
            own = [f.alternative for f in best[:LEADERS] if f.linearisation == i]
            ahead = [a for a in own if a.names[-1][0] in reached and a.gain > reached[a.names[-1][0]].gain]
            jobs += (Job(i, s, warm) for s, warm in constants(linearisation.scorer, ahead))
        return self._run(jobs)

    def bent(self, followers: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
        """Dependences that came to no more than the constant at their site, which they contain: again, from there."""
        ended = best_of_each(last)
        return self._run(
            [job for f in followers for job in unbent(f, ended, self.linearisations[f.linearisation].scorer)]
        )

    def steps(self, followers: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
        """Steps, which are simulated at every row: only where an event near the best came to be as short as one."""
        most = max((fitted.alternative.gain for fitted in (*followers, *last)), default=0.0)
        near = [fitted for fitted in best_of_each(followers) if fitted.alternative.gain > CLOSE_GAIN * most]
        return self._run([job for fitted in near for job in step(fitted, self.high - self.low)])

    def freed(self, best: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
        """Time profiles with more freedom where that pays; whom a rough profile is to tell apart must all have it."""
        freed = self._freer(best[:FREED], best, last)
        if freed:
            ended = {fitted.alternative.names for fitted in last}
            others = [fitted for fitted in best[FREED:MOST_FREED] if fitted.alternative.names in ended]
            freed += self._freer(others, best, last)
        return freed

    def trimmed(self, jobs: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
        """Curves without the knots that they do not need, so that no profile loses for a freedom it did not use.

        Where another form is the best of a name so far, its curve is trimmed all the same.
        """
        names = {fitted.alternative.names for fitted in jobs}
        every = [fitted for fitted in (*jobs, *last) if fitted.alternative.names in names and is_curve(fitted)]
        curves = best_of_each(every)
        return self._run(self._fewer([*(fitted for fitted in jobs if not is_curve(fitted)), *curves]))

    def _fewer(self, jobs: list[FittedJob]) -> list[Job]:
        most = max((fitted.alternative.gain for fitted in jobs), default=0.0)
        near = [fitted for fitted in jobs if fitted.alternative.gain > CLOSE_GAIN * most]
        count = self.fitter.problem.count(self.fitter.rows)
        return fewer_knots(near, float(np.log(max(count, 2))))

    def _freer(self, jobs: list[FittedJob], best: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
        names = {fitted.alternative.names for fitted in jobs}
        curves = best_of_each([fitted for fitted in last if fitted.alternative.names in names and is_curve(fitted)])
        both = [*(fitted for fitted in jobs if not is_curve(fitted)), *curves]
        free = self._run([job for fitted in both for job in more_freedom(fitted, self.low, self.high)])
        fewer = self._fewer(free)
        free += self._run([*fewer, *from_scratch(fewer)])
        bound = {fitted.alternative.names: fitted.alternative.fit for fitted in best}
        problem = self.fitter.problem
        return [r for r in free if worth_its_freedom(problem, bound[r.alternative.names], r.alternative.fit)]


def _is_constant(fitted: FittedJob) -> bool:
    return fitted.alternative.names[-1][1] == "constant"


def _words(jobs: Sequence[Job], most: int = 2) -> str:
    """Names of what a rung fits, the first few of them."""
    names = list(dict.fromkeys(" by ".join(job.score.candidate.name) for job in jobs))
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


def _close(alternatives: list[Alternative]) -> list[Alternative]:
    """Alternatives that gained about as much as the best: what else is far behind it is not worth more forms."""
    most = max((a.gain for a in alternatives), default=0.0)
    return [a for a in alternatives if a.gain > CLOSE_GAIN * most]


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


def _alternative(base: Fit, start: Fit, score: Score, fitted: Fit, before: Alternative | None) -> Alternative:
    fit = fitted.with_model(lambda: variant_model(start, score))
    return Alternative(
        (*(before.names if before else ()), score.candidate.name),
        (*(before.known if before else ()), nameable(fit.model, fit.model.fitted_effects()[-1], score.candidate.known)),
        fit,
        base.loss - fit.loss,
        fit.bic - base.bic,
    )
