"""Refit the best-scored candidates in two heats, each with its own noise model, and rank them.

First all of them in their best form with a few steps, then the finalists in several forms to the end; last, what only a
finished fit can start: events in time, and the constant that a dependence may have come to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.attribute import Alternative, fit_variant, fixed_coefficients
from adaptive_flot.discovery.catalogue import finer
from adaptive_flot.discovery.events import event_scores
from adaptive_flot.discovery.fit import Fit
from adaptive_flot.discovery.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.parallel import parallel_map
from adaptive_flot.discovery.scoring import Score, Scorer

FORMS_EACH = 2
FIRST_STEPS = 6
"""Steps of the first heat, in which every candidate runs."""
FINALISTS = 4
SURE_FINALISTS = 3
NEAR_FINALIST = 0.5
"""A finalist beyond the third must have gained at least this share of what the first gained."""


@dataclass(frozen=True)
class Lane:
    """A linearisation, whose fit the searches start from, and the candidates that are worth one."""

    scorer: Scorer
    scores: list[Score]


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

    def work(job: tuple[int, Score, int]) -> Fit | None:
        lane, score, steps = job
        fit = fit_variant(fitter, lanes[lane].scorer.fit, score, steps)
        return replace(fit, model=None) if fit else None  # type: ignore[arg-type]  # a model does not pickle

    def heat(jobs: list[tuple[int, Score]], steps: int) -> list[_Run]:
        fits = parallel_map(work, [(i, s, steps) for i, s in jobs], processes, done)
        found = [
            _Run(i, s, _alternative(base, lanes[i].scorer.fit, s, fit, before))
            for (i, s), fit in zip(jobs, fits, strict=True)
            if fit
        ]
        return sorted(found, key=lambda run: run.alternative.fit.bic)

    first = heat(
        [(i, f) for i, lane in enumerate(lanes) for s in lane.scores for f in _first_forms(lane, s)], FIRST_STEPS
    )
    furthest: dict[tuple[str, str], _Run] = {}
    for run in first:
        furthest.setdefault(run.score.candidate.name, run)
    finalists = _finalists(lanes[0].scorer.fit.loss, list(furthest.values()))
    last = heat([(r.lane, f) for r in finalists for f in _forms(lanes[r.lane], r.score.candidate.name)], MOST_STEPS)
    followers: list[tuple[int, Score]] = []
    for i, lane in enumerate(lanes):
        own = [run.alternative for run in last if run.lane == i]
        followers += [(i, s) for s in (*_constants(lane.scorer, own), *_events(lane.scores, own))]
    return _best_of_each([run.alternative for run in (*heat(followers, MOST_STEPS), *last, *first)])


def _finalists(loss: float, ranked: list[_Run]) -> list[_Run]:
    """Who goes on: the first few, and one more that comes near them; `loss` is that of the model as it is."""
    gains = [max(loss - run.alternative.fit.loss, 0.0) for run in ranked[:FINALISTS]]
    return [
        run
        for i, (run, gain) in enumerate(zip(ranked[:FINALISTS], gains, strict=True))
        if i < SURE_FINALISTS or gain > NEAR_FINALIST * gains[0]
    ]


def _best_of_each(found: list[Alternative]) -> list[Alternative]:
    """The best fit of each name, best first."""
    best: dict[tuple[tuple[str, str], ...], Alternative] = {}
    for a in sorted(found, key=lambda a: a.fit.bic):
        best.setdefault(a.names, a)
    return list(best.values())


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


def _forms(lane: Lane, name: tuple[str, str]) -> list[Score]:
    """Best variant of each form (and mode) of a candidate, if it comes near the best."""
    score = next(s for s in lane.scores if s.candidate.name == name)
    found: dict[tuple[str, str | None], Score] = {}
    for s in lane.scorer.variant_scores(score.candidate):
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
