"""Fits that a rung makes, and what each came to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Alternative

CLOSE_GAIN = 0.7
"""Share of the best gain from which more forms of a name are worth a fit."""


@dataclass(frozen=True)
class ScoredLinearisation:
    """Responses along one fit, from which the searches start, and the candidates that are worth one."""

    scorer: Scorer
    scores: list[Score]


@dataclass(frozen=True)
class Job:
    """A fit to be made in one linearisation, from scratch or from a fit of the same name."""

    linearisation: int
    score: Score
    warm: Fit | None = None
    drawn: bool = False
    """Whether the start values draw a curve that was fitted, and are no first-order estimate."""


@dataclass(frozen=True)
class FittedJob:
    """A job that was done: the alternative that it came to."""

    linearisation: int
    score: Score
    alternative: Alternative


def is_curve(fitted: FittedJob) -> bool:
    """Whether the form that was fitted is a free curve."""
    return fitted.score.variant.effect.family.is_curve


def is_constant(fitted: FittedJob) -> bool:
    """Whether a constant change was fitted."""
    return fitted.alternative.names[-1][1] == "constant"


def best_of_each(jobs: list[FittedJob]) -> list[FittedJob]:
    """The best fit of each name, best first."""
    best: dict[tuple[tuple[str, str], ...], FittedJob] = {}
    for fitted in sorted(jobs, key=lambda fitted: fitted.alternative.fit.bic):
        best.setdefault(fitted.alternative.names, fitted)
    return list(best.values())


def near(
    runs: Sequence[FittedJob], among: Sequence[FittedJob] | None = None, share: float = CLOSE_GAIN
) -> list[FittedJob]:
    """Those that gained about as much as the best of some others, by default of themselves."""
    most = max((fitted.alternative.gain for fitted in (runs if among is None else among)), default=0.0)
    return [fitted for fitted in runs if fitted.alternative.gain > share * most]
