"""What a record says about what the model lacks, and everything behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results.alternatives import Judgement, SearchResult
from adaptive_flot.discovery.results.evidence import Detection, Location, OutputChange
from adaptive_flot.discovery.results.experiment import Experiment
from adaptive_flot.discovery.results.least_shown import LeastShown
from adaptive_flot.discovery.results.words import NO_SITE, NOTHING_ADDED, Word
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model


@dataclass(frozen=True)
class NamedEffect:
    """An effect of the verdict: the fitted effect, 95 % intervals of its coefficients, and the next best names."""

    effect: Effect
    meaning: str
    interval95: Mapping[str, tuple[float, float]]
    alternatives: tuple[tuple[str, str, float, float], ...]
    """(site, driver, how much worse its criterion is, standard deviation of that)."""

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""
        return {
            **self.effect.as_dict(),
            "parameters": {k: float(v) for k, v in self.effect.coefficients.items()},
            "meaning": self.meaning,
            "interval95": {k: list(v) for k, v in self.interval95.items()},
            "alternatives": [
                {"site": s, "driver": d, "delta_bic": round(v, 1), "sd": round(sd, 1)}
                for s, d, v, sd in self.alternatives
            ],
        }


@dataclass(frozen=True)
class Verdict:
    """What a record says about what the model lacks.

    Attributes
    ----------
    word
        `none`, `named`, `class`, `unnamed`, `insufficient` or `abstain`.
    reason
        One paragraph of plain words.
    effects
        What was named, or the unnamed curve, best first.
    members
        (site, driver) of each member of a class.
    error
        Free-run error of each output on the held-out split.
    report_times
        First and last time [s] of each part of the record in that split; empty when another record reported.
    tests
        Ljung-Box p values of the grade (the first output) before and after, and other tests.
    detection, location
        What the residual of the model as it is shows, and where it points; None when nothing was fitted or scored.
    parameters
        Adapted parameters in the final fit, by label.
    drift
        Change of adapted parameters with time, in words, where that explains the record.
    absorbed
        Change of each adapted parameter that the plain fit needed to mimic the effect, as a share, by label.
    notes
        What was left out or stays open.
    shortcomings
        Why the record says too little, one by one; empty where it was judged.
    experiment
        Input moves that would tell the leading alternatives apart; None where there is but one.
    least_shown
        The smallest change at each site that the record shows, where it is `none`.
    seconds
        Wall-clock time.
    """

    word: Word
    reason: str
    effects: tuple[NamedEffect, ...] = ()
    members: tuple[tuple[str, str], ...] = ()
    error: tuple[OutputChange, ...] = ()
    split: str = "report"
    report_times: tuple[tuple[float, float], ...] = ()
    tests: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    drift: tuple[str, ...] = ()
    absorbed: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    shortcomings: tuple[str, ...] = ()
    detection: Detection | None = None
    location: Location | None = None
    experiment: Experiment | None = None
    least_shown: tuple[LeastShown, ...] = ()
    seconds: float = 0.0

    @property
    def sites(self) -> frozenset[str]:
        """Sites of what is named, and of every member of a class."""
        return frozenset(e.effect.site for e in self.effects) | frozenset(site for site, _ in self.members)

    @property
    def about_errors(self) -> str:
        """A word on errors that are the same before and after; empty where none is needed."""
        alike = bool(self.error) and all(c.after == c.before for c in self.error)
        return NOTHING_ADDED if alike and NO_SITE in self.reason else ""

    def as_dict(self) -> dict[str, Any]:
        """Return the machine-readable verdict."""
        return {
            "verdict": self.word,
            "reason": self.reason,
            "effects": [e.as_dict() for e in self.effects],
            "class": [{"site": s, "driver": d} for s, d in self.members],
            "error": {
                c.output: {
                    "unit": c.unit,
                    "before": c.before,
                    "after": c.after,
                    "noise": c.noise,
                    "reduction95": list(c.reduction95),
                    "block": self.split,
                }
                for c in self.error
            },
            "report_times_s": [list(part) for part in self.report_times],
            "tests": dict(self.tests),
            "detection": self.detection.as_dict() if self.detection else [],
            "location": self.location.as_dict() if self.location else None,
            "parameters": dict(self.parameters),
            "drift": list(self.drift),
            "absorbed": dict(self.absorbed),
            "notes": list(self.notes),
            "experiment": self.experiment.as_dict() if self.experiment else None,
            "least_shown": [s.as_dict() for s in self.least_shown],
            "seconds": round(self.seconds, 2),
        }

    def __str__(self) -> str:
        lines = [f"verdict: {self.word}", self.reason, *(f"  {c}" for c in self.error), *self.notes]
        return "\n".join(lines + ([str(self.experiment)] if self.experiment else []))


@dataclass(frozen=True)
class Discovery:
    """The verdict and everything behind it.

    Attributes
    ----------
    verdict
        What to tell.
    model
        The model with what was named (or the unnamed curve) added, fitted; the plain fitted model else.
    screening, problem, search, judgement
        The stages; None from the one that was not reached.
    before, after
        Fits of the plain and of the extended model to the estimation and confirm splits.
    told
        The second with the sizes that are told: with those of the innovations form where that has decided.
    """

    verdict: Verdict
    model: Model
    screening: Screening
    problem: Problem | None = None
    search: SearchResult | None = None
    judgement: Judgement | None = None
    before: Fit | None = None
    after: Fit | None = None
    told: Fit | None = None

    @property
    def by_process_noise(self) -> bool:
        """Whether the innovations form has decided, with sizes of its own."""
        return self.told is not None and self.told is not self.after
