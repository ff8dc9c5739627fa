"""Fits of combinations of named effects from scattered starts, and by how many errors their evidence counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.candidates.direction import nameable
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import fixed_coefficients, limited, shape_bounds
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole, FormKind
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.parallel import parallel_map

BEAM = 3
"""Alternatives of one round that the next extends."""
STARTS = 4
FIRST_STEPS = 15
LAST_STEPS = 60
FOLDS = 16
"""Blocks of the cross-validation: events are few, and without many of them nothing could be told."""
POLISHED = 4
"""Alternatives of a round that are fitted to the end."""
AFFORDED, LEAST_NAMED = 240_000, 6
"""Steps of a record times squared states, times the effects that are combined, the best by their scores; at least so
many effects. Each is fitted in some ten combinations, from four starts."""
SCATTER = 1.6
"""Adapted parameters start within this factor of the plain fit's."""


@dataclass(frozen=True)
class Combination:
    """Effects that are fitted at once: one score of each, in any order."""

    scores: tuple[Score, ...]

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """(site, driver) of each effect."""
        return tuple(s.candidate.name for s in self.scores)


class JointFits:
    """Rounds of combinations of named effects, each from scattered starts."""

    def __init__(self, problem: Problem, base: Fit, scorer: Scorer, processes: int) -> None:
        self.problem, self.scorer, self.processes = problem, scorer, processes
        self.fitter, self.base = Fitter(problem), base
        # laws only: an event in time is found by the search of one effect after the other, and a free curve in time
        # fits whatever the blocks of the record hold
        named = [s for s in scorer.scores() if s.candidate.known]
        laws = [s for s in named if s.candidate.driver in scorer.drivers or _zero(s)]
        self.named = laws[: max(LEAST_NAMED, AFFORDED // max(cost_of_a_run(problem, base), 1))]
        self.ranges = {k: (float(np.min(v)), float(np.max(v))) for k, v in scorer.drivers.items()}

    def rounds(self, most: int, done: Callable[[], None] = lambda: None) -> list[list[Alternative]]:
        """Alternatives with one effect, with two, ... up to `most`, each list best first."""
        ranked_rounds: list[list[Alternative]] = []
        kept: list[Combination] = [Combination(())]
        for _ in range(most):
            wanted: dict[frozenset[tuple[str, str]], Combination] = {}
            for before in kept:
                for s in self.named:
                    if s.candidate.name not in before.names:
                        wanted.setdefault(
                            frozenset((*before.names, s.candidate.name)), Combination((*before.scores, s))
                        )
            if not wanted:
                break
            ranked = self._fits(list(wanted.values()), done)
            if not ranked:
                break  # the time is up
            ranked_rounds.append([a for a, _ in ranked])
            kept = [c for _, c in ranked[:BEAM]]
        return ranked_rounds

    def _fits(self, wanted: list[Combination], done: Callable[[], None]) -> list[tuple[Alternative, Combination]]:
        """Best of several starts of each combination; the best few to the end, from their best start and a new one."""

        def first(job: tuple[int, int]) -> Fit | None:
            return self._from_start(wanted[job[0]], job[1], FIRST_STEPS)

        jobs = [(c, k) for c in range(len(wanted)) for k in range(STARTS)]
        best: dict[int, tuple[float, int]] = {}
        for (c, k), fit in zip(jobs, parallel_map(first, jobs, self.processes, done), strict=True):
            if fit is not None and (c not in best or fit.loss < best[c][0]):
                best[c] = fit.loss, k
        order = sorted(best, key=lambda c: best[c][0])

        def last(job: tuple[int, int]) -> Fit | None:
            return self._from_start(wanted[job[0]], job[1], LAST_STEPS)

        jobs = [(c, k) for c in order[:POLISHED] for k in (best[c][1], *range(STARTS, 2 * STARTS))]
        jobs += [(c, best[c][1]) for c in order[POLISHED : 2 * POLISHED]]
        ended: dict[int, Alternative] = {}
        for (c, k), fit in zip(jobs, parallel_map(last, jobs, self.processes, done), strict=True):
            if fit is not None and (c not in ended or fit.loss < ended[c].fit.loss):
                ended[c] = self._alternative(wanted[c], k, fit)
        return sorted(((a, wanted[c]) for c, a in ended.items()), key=lambda x: x[0].fit.bic)

    def _variants(self, combination: Combination, k: int) -> list[Score]:
        """The best variant of each effect at start 0; another one of its best form at the others."""
        rng = np.random.default_rng([k, len(combination.scores)])
        variants = []
        for s in combination.scores:
            same = [v for v in self.scorer.variant_scores(s.candidate) if _form(v) == _joint_form(self.scorer, s)]
            variants.append(same[0] if k == 0 else same[int(rng.integers(len(same)))])
        return variants

    def _from_start(self, combination: Combination, k: int, steps: int) -> Fit | None:
        if self.problem.time_is_up:
            return None
        variants = self._variants(combination, k)
        rng = np.random.default_rng([k, 7])
        effects = [v.variant.effect for v in variants]
        held = [fixed_coefficients(e) for e in effects]
        model = self._model(effects)
        start: dict[str, float] = {}
        bounds: dict[str, tuple[float, float]] = {}
        free = list(self.base.names)
        for v, e, h in zip(variants, effects, held, strict=True):
            # small: what the linearisation far from the truth proposes leads astray
            first = {c.name: c.scale * rng.uniform(0.1, 1.0) if c.lower == 0 else c.default for c in e.terms}
            start |= limited(model, e, {e.parameter(n): x for n, x in {**first, **dict(v.variant.start), **h}.items()})
            free += [e.parameter(c.name) for c in e.terms if c.name not in h]
            bounds |= shape_bounds(self.problem, e)
            if e.driver in self.ranges:
                bounds |= {e.parameter(n): self.ranges[e.driver] for n in e.names(CoefficientRole.THRESHOLD)}
        if k:
            factors = np.exp(np.log(SCATTER) * rng.uniform(-1, 1, len(self.base.names)))
            start |= dict(zip(self.base.names, map(float, self.base.values * factors), strict=True))
        return self.fitter.fit(model, tuple(free), start, self.base, bounds, rounds=2, steps=steps)

    def _model(self, effects: list[Effect]) -> Model:
        return self.base.model.with_effects([replace(e, coefficients=fixed_coefficients(e)) for e in effects])

    def _alternative(self, combination: Combination, k: int, fitted: Fit) -> Alternative:
        effects = [v.variant.effect for v in self._variants(combination, k)]
        fit = fitted.with_model(lambda: self._model(effects))
        known = tuple(nameable(fit.model, e, True) for e in fit.model.fitted_effects()[-len(effects) :])
        return Alternative(combination.names, known, fit, self.base.loss - fit.loss, fit.bic - self.base.bic)


def cost_of_a_run(problem: Problem, fit: Fit) -> int:
    """Steps of a record times squared states."""
    return len(problem.record) * Stepper(fit.model, problem.record.dt).substeps * len(fit.initial_state) ** 2


def _zero(score: Score) -> bool:
    """Whether this is the zero or gain of a sensor; a constant factor elsewhere is one of the parameters already."""
    return score.candidate.driver == "constant" and score.candidate.site.role == "sensor"


def _form(score: Score) -> tuple[str, str | None]:
    return score.variant.effect.form, score.variant.effect.mode


def _joint_form(scorer: Scorer, score: Score) -> tuple[str, str | None]:
    """The form in which an effect takes part: the spill of a flow where it has one, else the form that scores best."""
    variants = scorer.variant_scores(score.candidate)
    spill = next((v for v in variants if v.variant.effect.family.kind is FormKind.THRESHOLD), variants[0])
    return _form(spill)


def correlation_time(problem: Problem, fit: Fit) -> float:
    """Rows of the residual for each effective sample, in the worst output."""
    residual: FloatArray = fit.residual(problem)[problem.rows("estimate", "confirm")]
    return float(np.max(correlation_times(residual)))


def discount(problem: Problem, fit: Fit, rows: float) -> Fit:
    """The same fit with evidence counted once every `rows` rows: its criterion is that of the effective samples.

    BIC = loss / rows + q log(N / rows), with N measurements and q parameters. N / rows is the effective sample size of
    correlated errors (see `correlation_times`).
    """
    count = max(problem.count(problem.rows("estimate")) / rows, 2.0)
    return replace(fit, bic=float(fit.loss / rows + len(fit.names) * np.log(count)))


def discounted(problem: Problem, base: Fit, alternatives: list[Alternative], rows: float) -> tuple[Alternative, ...]:
    """The same alternatives with evidence counted once every `rows` rows, best first; so is that of `base` already."""
    ranked = []
    for a in alternatives:
        fit = discount(problem, a.fit, rows)
        ranked.append(replace(a, fit=fit, gain=a.gain / rows, delta_bic=fit.bic - base.bic))
    return tuple(sorted(ranked, key=lambda a: a.fit.bic))


def cross_validated(problem: Problem, fit: Fit, processes: int) -> Fit:
    """The same fit, with each of FOLDS blocks of neighbouring rows predicted by a fit that did not see it.

    Cross-validation: Stone, *J. R. Statist. Soc. B* 36 (1974) 111; by blocks, as rows depend on one another: Burman,
    Chow & Nolan, *Biometrika* 81 (1994) 351.
    """
    rows = np.flatnonzero(problem.rows("estimate"))
    blocks = np.array_split(rows, FOLDS)

    def without(block: NDArray[np.intp]) -> FloatArray | None:
        hidden = problem.splits.copy()
        hidden[block] = ""
        refitted = Fitter(replace(problem, splits=hidden)).fit(fit.model, fit.names, like=fit, rounds=1)
        return refitted.predicted[block] if refitted else None

    predicted = fit.predicted.copy()
    for block, values in zip(blocks, parallel_map(without, blocks, processes), strict=True):
        predicted[block] = np.nan if values is None else values
    return replace(fit, predicted=predicted)
