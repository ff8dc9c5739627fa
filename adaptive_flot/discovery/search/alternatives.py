"""Attribute: which candidates are worth a full fit, and that fit.

A name is (site, driver); its forms compete inside it, so that no name wins or loses for the shape of one curve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import FINE_TIME_KNOTS
from adaptive_flot.discovery.candidates.dynamics import LONGEST_DELAY
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole, FormKind, number
from adaptive_flot.greybox.model import FloatArray, Model

SHORTLIST = 12
"""Candidates that are refitted in full."""
SHORTLIST_EACH = 3
"""Of which so many at one site: a first-order gain says more about the site than about the driver."""
LEAST_SHARE = 0.3
"""A candidate whose first-order gain is below this share of the best one's is not refitted."""
MOST_CHANGE = float(np.log(10))
"""A physical effect changes a quantity by a factor of ten at most; beyond it is another model, or none with a grip."""
PATIENCE = 4
"""Times as many steps as usual for the width of a turn: it moves slowly, and the initial state with it."""
WORTH_A_RESTART = 10.0
"""Gain of another start of a free time profile, which has most places to rest in, that is worth yet another."""
EACH_OUTPUT = 2
"""Candidates for each output that is still wrong: over all outputs they may rank low."""
LEAST_PULSE_ROWS, EDGES = 10, 6.5
"""Least rows that a change which comes and goes lasts, and least widths of its edges: it gets to 92 % of its size."""
SAME_DRIVER = 1e-6
"""Drivers whose correlation differs from one by less say the same (level and froth depth)."""


def shortlist(scorer: Scorer, count: int = SHORTLIST, scores: Sequence[Score] | None = None) -> list[Score]:
    """Candidates worth a full fit, best first.

    Left out is what adds nothing to a constant at its own site, and of two drivers that are one another's mirror (level
    and froth depth) the one without a name; else the one that scores worse; else the later one in the model.
    """
    scores = scorer.scores() if scores is None else scores
    best = scores[0].gain if scores else 0.0
    constant = {s.candidate.site.name: s.penalised for s in scores if s.candidate.driver == "constant"}
    kept: list[Score] = []
    for score in scores:
        c = score.candidate
        if score.penalised <= 0 or score.gain < LEAST_SHARE * best:
            continue
        if c.driver != "constant" and score.penalised <= constant.get(c.site.name, -np.inf) + 5.0:
            continue
        twin = next((k for k in kept if _twins(k, score, scorer.drivers)), None)
        if twin is not None:
            if _preferred(score, twin, list(scorer.drivers)):
                kept[kept.index(twin)] = score
            continue
        if sum(k.candidate.site.name == c.site.name for k in kept) < SHORTLIST_EACH:
            kept.append(score)
    return _spread(kept, count)


def with_hidden(wanted: list[Score], scores: Sequence[Score]) -> list[Score]:
    """The wanted candidates, and those that act where no small change shows: their scores say little of a fit.

    A valve that is shut for most of the time, and leaks, was the 60th of 128. Its fit was better than all others.
    """
    names = {s.candidate.name for s in wanted}
    hidden = (s for s in scores if any(profile.response is not None for profile in s.variant.profiles))
    return [*wanted, *(s for s in hidden if s.candidate.name not in names)]


def with_each_output(scorer: Scorer, wanted: list[Score], outputs: Sequence[int]) -> list[Score]:
    """The wanted candidates, and those that explain most of each of some outputs (their places).

    These need no name: what explains an output that all the rest leaves wrong can not explain just anything.
    """
    names = {s.candidate.name for s in wanted}
    for j in outputs:
        best = _without_twins(scorer, scorer.scores_in_output(j))[:EACH_OUTPUT]
        wanted = [*wanted, *(s for s in best if s.candidate.name not in names)]
        names |= {s.candidate.name for s in best}
    return wanted


def _without_twins(scorer: Scorer, ranked: list[Score]) -> list[Score]:
    kept: list[Score] = []
    for score in ranked:
        if not any(_twins(k, score, scorer.drivers) for k in kept):
            kept.append(score)
    return kept


def _spread(ranked: list[Score], count: int) -> list[Score]:
    """So many of the ranked candidates: two thirds by rank, the rest of sites that are not among those, best first."""
    chosen = ranked[: count - count // 3]
    sites = {s.candidate.site.name for s in chosen}
    further = ranked[len(chosen) :]
    firsts: list[Score] = []
    for s in further:
        if s.candidate.site.name not in sites:
            sites.add(s.candidate.site.name)
            firsts.append(s)
    names = {s.candidate.name for s in (*chosen, *firsts)}
    others = [s for s in further if s.candidate.name not in names]
    picked = {s.candidate.name for s in (*chosen, *firsts, *others)[:count]}
    return [s for s in ranked if s.candidate.name in picked]


def _twins(a: Score, b: Score, drivers: Mapping[str, FloatArray]) -> bool:
    """Whether two candidates at one site explain exactly the same: their drivers are functions of one another."""
    one, other = a.candidate, b.candidate
    if one.site.name != other.site.name or one.driver not in drivers or other.driver not in drivers:
        return False
    return abs(float(np.corrcoef(drivers[one.driver], drivers[other.driver])[0, 1])) > 1 - SAME_DRIVER


def _preferred(score: Score, twin: Score, order: list[str]) -> bool:
    """Whether a mirror that scored no better is the one to keep. Where both score alike, rounding must not choose."""
    own, other = score.candidate, twin.candidate
    if own.known != other.known:
        return own.known
    alike = score.gain > (1 - SAME_DRIVER) * twin.gain
    return alike and order.index(own.driver) < order.index(other.driver)


def fit_variant(
    fitter: Fitter, start: Fit, score: Score, steps: int, warm: Fit | None = None, drawn: bool = False
) -> Fit | None:
    """Full fit of one variant on top of `start`, from the score's values or, where these are too large, smaller ones.

    `warm` is a fit with another form of the same effect: its adapted parameters and initial state are a better start.
    Values that were `drawn` by a fit are taken as they are.
    """
    start = _warmed(start, warm) if warm else start
    effect = score.variant.effect
    held = fixed_coefficients(effect)
    model = variant_model(start, score)
    names = tuple(effect.parameter(c.name) for c in effect.terms if c.name not in held)
    free = (*start.names, *names)
    bounds = effect_bounds(fitter.problem, model, effect)
    first = {effect.parameter(k): v for k, v in {**score.start, **held}.items()}
    rounds = 1 if steps < MOST_STEPS else 2
    shape = {effect.parameter(k) for k, _ in score.variant.start}
    shrink = [] if warm else [n for n in names if n in first and n not in shape]
    first = first if drawn else limited(model, effect, first)
    later = {effect.parameter(n) for n in effect.names(CoefficientRole.THRESHOLD) if effect.family.memory}
    width = {effect.parameter(n) for n in effect.names(CoefficientRole.BAND) if effect.family.turns}
    if width or (later and warm is None):
        fit = _size_first(fitter, model, free, later | width, (first, start, bounds, rounds, steps, shrink))
    else:
        fit = fitter.fit(model, free, first, start, bounds, rounds, steps, shrink)
    in_time = effect.driver == "time" and effect.family.is_curve and len(names) <= FINE_TIME_KNOTS
    if fit is not None and steps == MOST_STEPS and (in_time or width):
        return fitter.settled(fit, bounds, WORTH_A_RESTART)
    return fit


def _size_first(
    fitter: Fitter,
    model: Model,
    free: tuple[str, ...],
    later: set[str],
    how: tuple[dict[str, float], Fit, dict[str, tuple[float, float]], int, int, list[str]],
) -> Fit | None:
    """The fit of a switch by a signal: its size with the thresholds of its score, then the thresholds as well.

    While the size is far off, a threshold moves to where it hides the switch. So a few steps are for the size alone.
    The same holds for the width over which a change turns with the sign of its driver.
    """
    first, start, bounds, rounds, steps, shrink = how
    turns = model.effects[-1].family.turns
    starts, patience = (_starts(fitter, start), PATIENCE) if turns else ((start,), 1)
    sizes = tuple(n for n in free if n not in later)
    tried = [fitter.fit(model, sizes, first, each, bounds, rounds, steps, shrink) for each in starts]
    size = min((fit for fit in tried if fit is not None), key=lambda fit: fit.loss, default=None)
    if size is None:
        return None
    there = {n: first[n] for n in later}
    fit = fitter.fit(size.model, free, there, size, bounds, rounds, patience * steps) if steps == MOST_STEPS else None
    if fit is None or fit.loss > size.loss:
        return fitter.fit(size.model, free, there, size, bounds, 0) or fit
    return fit


def _starts(fitter: Fitter, start: Fit) -> tuple[Fit, Fit]:
    """A fit to start from, and the same in the initial state that the model assumes.

    Where much is missing, the initial state of the fit without it may be absurd, and a fit that starts there may stay.
    """
    assumed = Unknowns(fitter.problem, start.model, (), {}, None, {}).x0
    return start, replace(start, initial_state=assumed)


def variant_model(start: Fit, score: Score) -> Model:
    """The model of a fit with one variant on top, before it is fitted."""
    effect = score.variant.effect
    return start.model.with_effects([replace(effect, coefficients=fixed_coefficients(effect))])


def _warmed(start: Fit, warm: Fit) -> Fit:
    """The fit with the free parameters and the initial state that it has in common with another."""
    values = dict(zip(warm.names, map(float, warm.values), strict=True))
    common = start.model.with_parameters({n: values[n] for n in start.names})
    return replace(start, model=common, initial_state=warm.initial_state[: len(start.initial_state)])


def fixed_coefficients(effect: Effect) -> dict[str, float]:
    """Coefficients that a search holds: the fraction of a lag, a dead time or a limit; the band of what jumps.

    Between two bands with other jumps a fit finds no slope. A rest is fitted where there is one.
    """
    held = dict.fromkeys(effect.names(CoefficientRole.BLEND), 1.0)
    if effect.family.jumps:
        chosen = effect.coefficients
        held |= {name: chosen[name] for name in effect.names(CoefficientRole.BAND) if name in chosen}
        held |= {name: 0.0 for name in effect.names(CoefficientRole.REST) if not chosen.get(name)}
    return held


def limited(model: Model, effect: Effect, start: dict[str, float]) -> dict[str, float]:
    """Start values inside their ranges, and a change at a site by at most a factor of two and a half."""
    inside = {}
    factor = (effect.mode or next(s.mode for s in model.sites if s.name == effect.site)) == "factor"
    for c in effect.terms:
        name = effect.parameter(c.name)
        if name in start:
            parameter = model.parameters[model.index("parameters", name)]
            value = float(np.clip(start[name], parameter.lower, parameter.upper))
            inside[name] = float(np.clip(value, -0.9, 0.9)) if c.is_level and factor else value
    return inside


def effect_bounds(problem: Problem, model: Model, effect: Effect) -> dict[str, tuple[float, float]]:
    """Ranges of an effect's coefficients by full name: those of its shape, and of the change of a quantity."""
    bounds = shape_bounds(problem, effect)
    site = next(s for s in model.sites if s.name == effect.site)
    if (effect.mode or site.mode) == "factor":
        bounds |= {effect.parameter(c.name): (-MOST_CHANGE, MOST_CHANGE) for c in effect.terms if c.is_level}
        if effect.family.kind is FormKind.THRESHOLD:  # from one end of a line to the other
            slopes = effect.names(CoefficientRole.SLOPE)
            bounds |= {effect.parameter(name): (-2 * MOST_CHANGE, 2 * MOST_CHANGE) for name in slopes}
    return bounds


def shape_bounds(problem: Problem, effect: Effect) -> dict[str, tuple[float, float]]:
    """Ranges of an effect's shape by full name that the record sets: an event inside it, a duration at most its own."""
    t = problem.record.time
    span = float(t[-1] - t[0])
    margin = 0.02 * span
    dt = problem.record.dt
    # an event must be able to become a step within a row, whose onset lies where it will; but a lag within a row would
    # stand for a little of anything, such as constants that are off
    shortest = min(1.0, dt)
    is_event = any(c.role is CoefficientRole.ONSET for c in effect.terms)
    by_role = {
        CoefficientRole.ONSET: (float(t[0]) + margin, float(t[-1]) - margin),
        CoefficientRole.DURATION: (shortest, span),
        CoefficientRole.TIME_CONSTANT: (max(0.2 * dt, shortest) if is_event else dt, span),
        CoefficientRole.DEAD_TIME: (2.0 * dt, LONGEST_DELAY * span),
        CoefficientRole.READING: (float(t[0]) - span, float(t[-1])),
    }
    if effect.family.passes:  # what is shorter is an outlier, or noise
        width = number(effect.full_settings, "width")
        by_role[CoefficientRole.DURATION] = max(LEAST_PULSE_ROWS * dt, EDGES * width), span
    return {effect.parameter(c.name): by_role[c.role] for c in effect.terms if c.role in by_role}
