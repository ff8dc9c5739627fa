"""Events in time, which only a fitted curve can start, and lines with kinks, which start from a curve over a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.candidates.dynamics import FOLLOWS
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.shapes.limited_lines import limited_lines
from adaptive_flot.discovery.candidates.shapes.relays import LAGS
from adaptive_flot.discovery.candidates.shapes.step_events import event_scores, other_shape, slower_scores, step_score
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import EDGES
from adaptive_flot.discovery.search.halving.constants import constants
from adaptive_flot.discovery.search.halving.jobs import CLOSE_GAIN, FittedJob, Job, best_of_each, is_curve, near
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.greybox.effects import STATELESS_DRIVERS
from adaptive_flot.greybox.forms.form import CoefficientRole, number

MOST_PROFILES = 6
"""Curves in time that are tried as events."""
MOST_LINES = 3
"""Curves over a signal that are tried as a line with kinks."""
MOST_SOFT = 8
"""Names, the best first, whose pulses are tried with softer edges."""
EDGE_ROWS = (3.0, 6.0, 12.0, 24.0)
"""Rows over which the edges of a pulse are rounded that are tried beside sharp ones."""


def followers(refit: Refit, last: list[FittedJob]) -> list[FittedJob]:
    """Constants and events, which only a finished fit can start."""
    jobs: list[Job] = []
    for i, linearisation in enumerate(refit.linearisations):
        own = [fitted.alternative for fitted in last if fitted.linearisation == i]
        jobs += (Job(i, s, warm) for s, warm in constants(linearisation.scorer, own))
        jobs += (Job(i, s) for s in events(linearisation.scores, _close(own)))
    return refit.run(jobs)


def _close(alternatives: list[Alternative]) -> list[Alternative]:
    """Alternatives that gained about as much as the best: what else is far behind it is not worth more forms."""
    most = max((a.gain for a in alternatives), default=0.0)
    return [a for a in alternatives if a.gain > CLOSE_GAIN * most]


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


def lines(refit: Refit, last: list[FittedJob]) -> list[FittedJob]:
    """Lines with kinks, which start from a fitted curve over a signal."""
    curves = best_of_each([fitted for fitted in near(last) if is_curve(fitted)])
    return refit.run(with_kinks(curves, [each.scorer for each in refit.linearisations]))


def with_kinks(curves: list[FittedJob], scorers: Sequence[Scorer]) -> list[Job]:
    """Lines with kinks in place of the best curves over a signal; `scorers` tell what each signal has seen."""
    over_a_signal = [f for f in curves if f.alternative.effects[-1].driver not in STATELESS_DRIVERS]
    jobs = []
    for f in over_a_signal[:MOST_LINES]:
        effect = f.alternative.effects[-1]
        seen = scorers[f.linearisation].drivers[effect.driver]
        jobs += [Job(f.linearisation, s, f.alternative.fit, drawn=True) for s in limited_lines(f.score, effect, seen)]
    return jobs


def ramps_and_washouts(refit: Refit, followers: list[FittedJob]) -> list[FittedJob]:
    """Ramps and washouts of names near the best as each other, where the one came much further than the other.

    Each started where a curve with few knots drew it. From there an onset may have run away.
    """

    def reached(name: tuple[tuple[str, str], ...], form: str) -> float:
        there = (f for f in followers if f.alternative.names == name and f.alternative.effects[-1].form == form)
        return max((f.alternative.gain for f in there), default=0.0)

    jobs = []
    for fitted in best_of_each(near(followers)):
        for job in ramp_or_washout(fitted):
            other = reached(fitted.alternative.names, job.score.variant.effect.form)
            jobs += [job] if other < CLOSE_GAIN * fitted.alternative.gain else []
    return refit.run(jobs)


def ramp_or_washout(fitted: FittedJob) -> list[Job]:
    """A fitted ramp as a washout, and a washout as a ramp, from where it stands; nothing for other forms."""
    score = other_shape(fitted.score, fitted.alternative.effects[-1])
    return [Job(fitted.linearisation, score, fitted.alternative.fit, drawn=True)] if score else []


def steps(refit: Refit, followers: list[FittedJob], last: list[FittedJob]) -> list[FittedJob]:
    """Steps, which are simulated at every row: only where an event near the best came to be as short as one."""
    close = near(best_of_each(followers), (*followers, *last))
    return refit.run([job for fitted in close for job in step(fitted, refit.high - refit.low)])


def step(fitted: FittedJob, span: float) -> list[Job]:
    """A step where a fitted event is over soon, from where it stands; `span` is the length of the record [s]."""
    score = step_score(fitted.score, fitted.alternative.effects[-1], span)
    return [Job(fitted.linearisation, score, fitted.alternative.fit, drawn=True)] if score else []


def slower(refit: Refit, best: list[FittedJob]) -> list[FittedJob]:
    """Events that take their time, where a step is the best of a name: its curve may have been far too coarse."""
    return refit.run([job for fitted in near(best) for job in around_step(fitted, refit.high - refit.low)])


def around_step(fitted: FittedJob, span: float) -> list[Job]:
    """A ramp and a washout around a fitted step, where that is what was fitted; `span` is that of the record [s]."""
    around = slower_scores(fitted.score, fitted.alternative.effects[-1], span)
    return [Job(fitted.linearisation, s, fitted.alternative.fit, drawn=True) for s in around]


def softer(refit: Refit, best: list[FittedJob]) -> list[FittedJob]:
    """Pulses and switches that take longer to move: else the site is told by how sharp its outputs' edges are."""
    dt = refit.fitter.problem.record.dt
    return refit.run([job for f in near(best[:MOST_SOFT]) for job in (*soft_edges(f, dt), *slow_switches(f, dt))])


def soft_edges(fitted: FittedJob, dt: float) -> list[Job]:
    """A fitted pulse with edges over EDGE_ROWS rows, from where it stands; nothing for other forms.

    Edges that would take up the pulse are left out: its size would be that of a pulse which never gets there.
    """
    effect = fitted.alternative.effects[-1]
    if not effect.family.passes:
        return []
    shortest = min(effect.values(CoefficientRole.DURATION))
    widths = (rows * dt for rows in EDGE_ROWS if EDGES * rows * dt < shortest)
    return [_with_setting(fitted, "width", width) for width in widths]


def slow_switches(fitted: FittedJob, dt: float) -> list[Job]:
    """A fitted switch by a signal that moves within a row, or over LAGS rows, from where it stands; none else."""
    effect = fitted.alternative.effects[-1]
    if not effect.family.memory:
        return []
    own = number(effect.full_settings, "follow_s")
    return [_with_setting(fitted, "follow_s", rows * dt) for rows in (FOLLOWS, *LAGS) if rows * dt != own]


def _with_setting(fitted: FittedJob, name: str, value: float) -> Job:
    """The same form with another value of one of its settings, from where it stands."""
    effect = fitted.alternative.effects[-1]
    other = replace(effect, coefficients={}, settings={**effect.settings, name: value})
    start = {c.name: effect.coefficients[c.name] for c in effect.terms}
    shape = tuple((c.name, start[c.name]) for c in effect.terms if c.is_shape)
    variant = Variant(other, (), tuple(n for n in start if n not in dict(shape)), shape)
    score = replace(fitted.score, variant=variant, start=start)
    return Job(fitted.linearisation, score, fitted.alternative.fit, drawn=True)
