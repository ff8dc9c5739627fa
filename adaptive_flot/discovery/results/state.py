"""What the stages of `discover` hand on: the question, and what has been worked out so far."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results.alternatives import FirstRound, Judgement, SearchResult
from adaptive_flot.discovery.results.evidence import Detection, OutputChange
from adaptive_flot.discovery.results.experiment import Experiment
from adaptive_flot.discovery.results.least_shown import LeastShown
from adaptive_flot.discovery.results.verdict import Discovery, Verdict
from adaptive_flot.discovery.results.words import TELLING
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model


@dataclass(frozen=True)
class State:
    """What a stage of `discover` receives and hands on.

    Attributes
    ----------
    model
        The model as it came.
    adapted
        Full names of the parameters that are free in every alternative.
    report_record
        A further record that reports, and for which no part of the first one is kept; None without.
    limits
        Lowest and highest value of inputs by name in the test that is proposed; None for where the record has been.
    processes
        Fits that run at once.
    progress
        Called with a word for each stage.
    screening
        The record, and from the first stage on what in it can not be used.
    referred
        Whether a reference has shown that the model explains such records.
    steps_stay
        Whether the model has the steps that an effect has asked for, which are not made longer again.
    ends, search_ends
        When everything, and when the search, is to end, by `time.monotonic` [s].
    base_seconds
        What the fit of the model as it is took [s].
    problem, base
        The record in splits, and the fit of the model as it is to the estimation split.
    responses
        Linear responses along that fit, until the search has used them.
    scored
        Scores along that fit and sites of adapted parameters, where a stage before the search has needed them.
    first
        Single effects on top of that fit, until the search goes on from there.
    late
        By how much BIC falls with a lag or a dead time alone, by site and driver, where one was fitted.
    detection
        What the residual of that fit shows.
    search, judgement
        The ranked alternatives, and what they amount to.
    before, after
        Fits of the plain and of the extended model to the estimation and confirm splits.
    sizes
        The second with the sizes that the innovations form has, where it has decided: these are told.
    problem_after
        The problem of the second, whose background leaves out the constants that are told.
    error
        Error of each output on the report rows, before and after.
    likelihood
        Drop of minus two log-likelihood on these rows, an effective sample, where it stands for an error that falls.
    contradiction
        What these rows say against a name, in words; empty where they do not.
    certain
        What is certain although the record is not told, in words.
    background
        What is known of a feed that wanders and of constants that are off, in words; empty where neither is.
    without_a_site
        As if what acted where the model has no site, by the innovations form, in words; empty where nothing does.
    sentence
        What the innovations form names, in words; empty where it has not decided.
    experiment
        Input moves that would tell the leading alternatives apart.
    least_shown
        The smallest change at each site that the record shows.
    """

    model: Model
    adapted: tuple[str, ...]
    report_record: Dataset | None
    limits: Mapping[str, tuple[float, float]] | None
    processes: int
    progress: Callable[[str], None]
    screening: Screening
    referred: bool = False
    steps_stay: bool = False
    ends: float = float("inf")
    search_ends: float = float("inf")
    base_seconds: float = 0.0
    problem: Problem | None = None
    base: Fit | None = None
    responses: Responses | None = None
    scored: tuple[Scorer, tuple[str, ...]] | None = None
    first: FirstRound | None = None
    late: Mapping[tuple[str, str], float] = field(default_factory=dict)
    detection: Detection | None = None
    search: SearchResult | None = None
    judgement: Judgement | None = None
    before: Fit | None = None
    after: Fit | None = None
    sizes: Fit | None = None
    problem_after: Problem | None = None
    error: tuple[OutputChange, ...] = ()
    likelihood: float = 0.0
    contradiction: str = ""
    certain: str = ""
    background: str = ""
    sentence: str = ""
    experiment: Experiment | None = None
    least_shown: tuple[LeastShown, ...] = ()
    without_a_site: str = ""

    @property
    def known_problem(self) -> Problem:
        """The problem: of the stages after the record is split."""
        assert self.problem is not None
        return self.problem

    @property
    def fitted(self) -> tuple[Problem, Fit]:
        """The problem, and the fit of the model as it is: of the stages after that fit."""
        assert self.base is not None
        return self.known_problem, self.base

    @property
    def searched(self) -> tuple[Problem, SearchResult]:
        """The problem, and the ranked alternatives: of the stages after the search."""
        assert self.search is not None
        return self.known_problem, self.search

    @property
    def judged(self) -> Judgement:
        """What the alternatives amount to: of the stages after the judgement."""
        assert self.judgement is not None
        return self.judgement

    @property
    def refitted(self) -> tuple[Fit, Fit]:
        """Fits of the plain and of the extended model: of the stages after the last fits."""
        assert self.before is not None and self.after is not None
        return self.before, self.after

    @property
    def told(self) -> Fit:
        """The fit whose effects are told: the extended model, by the innovations form where that has decided."""
        return self.sizes or self.refitted[1]

    def ended(self, verdict: Verdict) -> Discovery:
        """The verdict with everything that stands behind it, at whatever stage it was given."""
        screening = self.screening
        if verdict.word == "insufficient":
            screening = replace(screening, reasons=verdict.shortcomings)
        before, after = self.before or self.base, self.after or self.base
        told = after if verdict.word in TELLING else before
        model = told.model if told is not None else self.model
        return Discovery(
            verdict, model, screening, self.problem, self.search, self.judgement, before, after, self.sizes or after
        )
