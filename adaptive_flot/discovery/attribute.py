"""Attribute: refit the best-scored candidates in full, each with its own noise model, and rank them.

A name is (site, driver); its forms compete inside it, so that no name wins or loses for the shape of one curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.catalogue import finer
from adaptive_flot.discovery.events import event_scores
from adaptive_flot.discovery.fit import Fit
from adaptive_flot.discovery.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.parallel import parallel_map
from adaptive_flot.discovery.problem import Problem
from adaptive_flot.discovery.scoring import Score, Scorer
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model

SHORTLIST = 10
"""Candidates that are refitted in full."""
FORMS_EACH = 2
FIRST_STEPS = 6
"""Steps of the first heat, in which every candidate runs."""
FINALISTS = 4
SURE_FINALISTS = 3
NEAR_FINALIST = 0.5
"""A finalist beyond the third must have gained at least this share of what the first gained."""
LEAST_SHARE = 0.3
"""A candidate whose first-order gain is below this share of the best one's is not refitted."""


@dataclass(frozen=True)
class Alternative:
    """A model with one or more further effects, fitted.

    Attributes
    ----------
    names
        (site, driver) of each effect, in the order they were added.
    known
        Whether each of them may be called by name.
    fit
        Its fit.
    gain
        Drop of minus two log-likelihood against the base model.
    delta_bic
        Its criterion less that of the base model; negative is better.
    """

    names: tuple[tuple[str, str], ...]
    known: tuple[bool, ...]
    fit: Fit
    gain: float
    delta_bic: float

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Its effects with fitted coefficients."""
        return self.fit.model.fitted_effects()[-len(self.names) :] if self.names else ()


def shortlist(scorer: Scorer, count: int = SHORTLIST) -> list[Score]:
    """Candidates worth a full fit, best first.

    Left out is what adds nothing to a constant at its own site, and the second of two drivers that are one another's
    mirror (level and froth depth) unless it is the one with a name.
    """
    scores = scorer.scores()
    best = scores[0].gain if scores else 0.0
    constant = {s.candidate.site.name: s.penalised for s in scores if s.candidate.driver == "constant"}
    kept: list[Score] = []
    for score in scores:
        c = score.candidate
        if score.penalised <= 0 or score.gain < LEAST_SHARE * best:
            continue
        if c.driver != "constant" and score.penalised <= constant.get(c.site.name, -np.inf) + 5.0:
            continue
        twin = next((k for k in kept if _twins(k, score)), None)
        if twin is not None:
            if c.known and not twin.candidate.known:
                kept[kept.index(twin)] = score
            continue
        kept.append(score)
    return kept[:count]


def _twins(a: Score, b: Score) -> bool:
    """Whether two candidates at one site explain exactly the same: their drivers are functions of one another."""
    same = a.candidate.site.name == b.candidate.site.name and a.variant.effect.form == b.variant.effect.form
    return same and a.variant.effect.form == "curve" and abs(a.gain - b.gain) < 1e-3 * max(a.gain, 1.0)


def refit(
    fitter: Fitter,
    base: Fit,
    scorer: Scorer,
    scores: list[Score],
    before: Alternative | None = None,
    processes: int = 1,
    done: Callable[[], None] = lambda: None,
) -> list[Alternative]:
    """Fit each shortlisted candidate on top of `before` (the base model by default), best first.

    The searches start from the fit that the scorer was linearised along. In two heats: all in their best form with a
    few steps, then the finalists in several forms to the end; last, what only a finished fit can start: events in time,
    and the constant that a dependence may have come to.
    """
    start = scorer.fit

    def work(job: tuple[Score, int]) -> Fit | None:
        fit = fit_variant(fitter, start, job[0], job[1])
        return replace(fit, model=None) if fit else None  # type: ignore[arg-type]  # a model does not pickle

    def heat(jobs: list[Score], steps: int) -> list[Alternative]:
        fits = parallel_map(work, [(s, steps) for s in jobs], processes, done)
        found = [_alternative(base, start, s, f, before) for s, f in zip(jobs, fits, strict=True) if f]
        return sorted(found, key=lambda a: a.fit.bic)

    scores = [scorer.refined(s) for s in scores]
    first = _best_of_each(heat([f for s in scores for f in _first_forms(scorer, s)], FIRST_STEPS))
    enough = NEAR_FINALIST * max((start.loss - first[0].fit.loss) if first else 0.0, 0.0)
    finalists = [
        a.names[-1] for i, a in enumerate(first[:FINALISTS]) if i < SURE_FINALISTS or start.loss - a.fit.loss > enough
    ]
    jobs = [f for s in scores if s.candidate.name in finalists for f in _forms(scorer, s)]
    last = heat(jobs, MOST_STEPS)
    followers = heat([*_constants(scorer, last), *_events(scores, last)], MOST_STEPS)
    return _best_of_each([*followers, *last, *first])


def _best_of_each(found: list[Alternative]) -> list[Alternative]:
    """The best fit of each name, best first."""
    best: dict[tuple[tuple[str, str], ...], Alternative] = {}
    for a in sorted(found, key=lambda a: a.fit.bic):
        best.setdefault(a.names, a)
    return list(best.values())


def _constants(scorer: Scorer, fitted: list[Alternative]) -> list[Score]:
    """The constant change at the sites of the best fits, from what a dependence on a driver came to.

    A dependence that turned out flat is that constant, which has the better name.
    """
    at = {s.candidate.site.name: s for s in scorer.scores() if s.candidate.driver == "constant"}
    found: dict[str, Score] = {}
    for a in fitted[:FINALISTS]:
        effect = a.effects[-1]
        site, c = effect.site, effect.coefficients
        values = [v for k, v in c.items() if k.startswith(("value", "amplitude"))]
        if effect.driver in ("constant", "time", "lag", "delay") or site not in at or site in found or not values:
            continue
        shift = next(v for v in scorer.variant_scores(at[site].candidate) if v.variant.effect.mode == effect.mode)
        found[site] = replace(shift, start={"amplitude": float(np.mean(values))})
    return list(found.values())


def _alternative(base: Fit, start: Fit, score: Score, bare: Fit, before: Alternative | None) -> Alternative:
    model = start.model.with_effects([score.variant.effect])
    held = {score.variant.effect.parameter(k): v for k, v in fixed_coefficients(score.variant.effect).items()}
    values = dict(zip(bare.names, map(float, bare.values), strict=True))
    fit = replace(bare, model=model.with_parameters({**held, **values}))
    return Alternative(
        (*(before.names if before else ()), score.candidate.name),
        (*(before.known if before else ()), score.candidate.known),
        fit,
        base.loss - fit.loss,
        fit.bic - base.bic,
    )


def _forms(scorer: Scorer, score: Score) -> list[Score]:
    """Best variant of each form (and mode) of a candidate, if it comes near the best."""
    found: dict[tuple[str, str | None], Score] = {}
    for s in scorer.variant_scores(score.candidate):
        key = s.variant.effect.form, s.variant.effect.mode
        if key not in found and s.gain > 0.5 * score.gain:
            found[key] = s
    forms = []
    in_time = score.candidate.driver == "time"
    kept = list(found.values())[:FORMS_EACH]
    if in_time:  # the best of all, and the curve that events start from
        kept = [score, *(s for k, s in found.items() if k[0] == "curve" and score.variant.effect.form != "curve")]
    for s in kept:
        fine = finer(s.variant, s.start)
        if fine:
            forms.append(replace(s, variant=fine[0], start=fine[1]))
        if not fine or in_time:
            forms.append(s)
    return forms


def _first_forms(scorer: Scorer, score: Score) -> list[Score]:
    """The forms of the first heat: the best one, and for what depends on time its curve too."""
    if score.candidate.driver != "time":
        return [score]
    curves = [s for s in scorer.variant_scores(score.candidate) if s.variant.effect.form == "curve"][:1]
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


def fit_variant(fitter: Fitter, start: Fit, score: Score, steps: int) -> Fit | None:
    """Full fit of one variant, from its first-order solution and, should that not simulate, from next to nothing."""
    effect = score.variant.effect
    held = fixed_coefficients(effect)
    model = start.model.with_effects([replace(effect, coefficients=held)])
    names = tuple(effect.parameter(c.name) for c in effect.terms if c.name not in held)
    free = (*start.names, *names)
    bounds = {effect.parameter(k): b for k, b in shape_bounds(fitter.problem).items()}
    first = {effect.parameter(k): v for k, v in {**score.start, **held}.items()}
    rounds = 1 if steps < MOST_STEPS else 2
    found = fitter.fit(model, free, limited(model, effect, first), start, bounds, rounds, steps)
    if found is None:
        shape = {effect.parameter(k) for k, _ in score.variant.start} | {effect.parameter(k) for k in held}
        small = {k: v if k in shape else 0.1 * v for k, v in first.items()}
        found = fitter.fit(model, free, limited(model, effect, small), start, bounds, rounds, steps)
    return found


def fixed_coefficients(effect: Effect) -> dict[str, float]:
    """Coefficients that a search holds: the share of a lag or dead time."""
    return {"amplitude": 1.0} if effect.driver in ("lag", "delay") else {}


def limited(model: Model, effect: Effect, start: dict[str, float]) -> dict[str, float]:
    """Start values inside their ranges, and a change at a site of at most a factor of two and a half."""
    found = {}
    for c in effect.terms:
        name = effect.parameter(c.name)
        if name in start:
            parameter = model.parameters[model.index("parameters", name)]
            value = float(np.clip(start[name], parameter.lower, parameter.upper))
            log_factor = c.name.startswith(("amplitude", "value")) and effect.shape.static is not None
            found[name] = float(np.clip(value, -0.9, 0.9)) if log_factor else value
    return found


def shape_bounds(problem: Problem) -> dict[str, tuple[float, float]]:
    """Ranges of shape coefficients that the record sets: an event inside it, a duration not longer than it."""
    t = problem.record.time
    span = float(t[-1] - t[0])
    margin = 0.02 * span
    return {
        "onset": (float(t[0]) + margin, float(t[-1]) - margin),
        "duration": (1.0, span),
        "time_constant": (0.2 * problem.record.dt, span),
        "dead_time": (2.0 * problem.record.dt, 0.2 * span),
    }
