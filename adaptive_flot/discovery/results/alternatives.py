"""Fitted alternatives, what a search has come to, and how it is judged."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.shapes.step_events import SLOW_S
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results.evidence import Verification
from adaptive_flot.discovery.results.words import Word
from adaptive_flot.greybox.effects import Effect

SURE = 2.0
"""Standard deviations by which an alternative must be worse to be told apart."""


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
    loglik_difference_sd
        Standard deviation of the difference between its minus two log-likelihood and that of the best one.
    adjusted_bic
        Its criterion with the common nuisance added, where that was worked out (see `adjust_for_common_nuisance`). Of
        alternatives to a pulse, with the confirm rows added. Where the innovations form has decided, that of its fits.
    problem
        Its own problem, where it has a background of its own: a course that is told as an effect.
    """

    names: tuple[tuple[str, str], ...]
    known: tuple[bool, ...]
    fit: Fit
    gain: float
    delta_bic: float
    loglik_difference_sd: float = 0.0
    adjusted_bic: float | None = None
    problem: Problem | None = None

    def worse_than(self, best: Alternative) -> float:
        """How much worse its criterion is than that of another, adjusted where both are."""
        if self.adjusted_bic is not None and best.adjusted_bic is not None:
            return self.adjusted_bic - best.adjusted_bic
        return self.fit.bic - best.fit.bic

    def near(self, best: Alternative, margin: float) -> bool:
        """Whether its criterion is worse by less than a margin, or than `SURE` standard deviations of that."""
        return self.worse_than(best) < max(margin, SURE * self.loglik_difference_sd)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Its effects with fitted coefficients."""
        return self.fit.model.fitted_effects()[-len(self.names) :] if self.names else ()


@dataclass(frozen=True)
class Round:
    """One round: what was scored on top of which alternative, what was fitted, and what it left.

    Attributes
    ----------
    scores
        First-order scores of the whole catalogue, best first.
    threshold
        Penalised score that noise alone passes once in a hundred records.
    alternatives
        Full fits, best first.
    compared
        Whether every finalist was fitted to the end, before the time was up.
    """

    scores: tuple[Score, ...]
    threshold: float
    alternatives: tuple[Alternative, ...]
    compared: bool = True


@dataclass(frozen=True)
class FirstRound:
    """Single effects on top of a base fit.

    Attributes
    ----------
    scorer
        Scores along that fit.
    sites
        Sites of its adapted parameters.
    round
        What the effects came to.
    """

    scorer: Scorer
    sites: tuple[str, ...]
    round: Round


@dataclass(frozen=True)
class SearchResult:
    """Everything a search found.

    Attributes
    ----------
    base
        Fit of the model as it is.
    rounds
        The rounds, in order.
    alternatives
        All full fits of the accepted number of effects, best first; empty when nothing was found.
    verification
        Of the best of them, on the confirm split.
    left
        First-order gain that the best alternative leaves on the table: what it still lacks.
    left_threshold
        The same quantity that noise alone would show once in a hundred records.
    adapted_sites
        Sites whose constant change is that of an adapted parameter.
    rows_per_effective_sample
        Rows of the best alternative's innovations for each effective sample: evidence counts once for so many.
    common_nuisance
        Site and driver of the effect that was added to the leading alternatives to compare them, if any.
    slow_s
        Seconds from which a change of an adapted parameter is a drift.
    """

    base: Fit
    rounds: tuple[Round, ...]
    alternatives: tuple[Alternative, ...]
    verification: Verification | None
    left: float
    left_threshold: float
    adapted_sites: tuple[str, ...]
    rows_per_effective_sample: float = 1.0
    common_nuisance: tuple[str, str] | None = None
    slow_s: float = SLOW_S


@dataclass(frozen=True)
class Judgement:
    """What the alternatives of a search amount to, before the words.

    Attributes
    ----------
    word
        One of six.
    best
        The alternative that is told, or the best of those that are not told apart.
    members
        (site, driver) of each member of a class.
    rivals
        The next best alternatives.
    margin
        How much worse a criterion must be to tell an alternative from the best (see `judge`).
    part
        (site, driver) of the effects of `best` that are told, where the others are not; empty where all are.
    beside
        The last member of a class in words, where it acts where the model has no site; else empty.
    """

    word: Word
    best: Alternative | None
    members: tuple[tuple[str, str], ...]
    rivals: tuple[Alternative, ...]
    margin: float
    part: tuple[tuple[str, str], ...] = ()
    beside: str = ""

    def near(self, a: Alternative) -> bool:
        """Whether the record does not tell an alternative from the best."""
        return self.best is not None and a.near(self.best, self.margin)
