"""What can be told at all: the effect is given, and how much its model gains over the background alone.

A name needs a gain of 10 in BIC for each effective sample. An effect that gains less, though its site and driver are
given, is not told: n, C and constants that are a little off, and a feed that wanders, do there what it does. Or no form
of the catalogue has its shape: then the gain says nothing of the record.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from adaptive_flot.api.models import read_model
from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE, rows_per_effective_sample
from adaptive_flot.discovery.background.evidence import Spread, cost
from adaptive_flot.discovery.background.linear import feeds_unseen
from adaptive_flot.discovery.background.renewed import renewed
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.discovery.results import State, Verdict
from adaptive_flot.discovery.search.halving.jobs import ScoredLinearisation
from adaptive_flot.discovery.search.halving.successive_halving import refit
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.discovery.stages import (
    allow_for_background,
    check_sufficient,
    examine_residual,
    fit_model_as_it_is,
    screen_record,
    split_rows,
)
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.registry import read_measurements

Name = tuple[str, str]
STAGES: tuple[Callable[[State], State | Verdict], ...] = (
    screen_record, check_sufficient, split_rows, check_sufficient, fit_model_as_it_is, examine_residual,
    allow_for_background,
)  # fmt: skip
"""What `discover` does before it scores effects."""


@dataclass(frozen=True)
class Gain:
    """Drop of BIC when the effect is given, and rows for each effective sample; NaN where it could not be fitted."""

    bic: float
    rows_each: float

    @property
    def visible(self) -> bool:
        """Whether a name may rest on it."""
        return self.bic >= LEAST_EVIDENCE * self.rows_each


def gain_of(model: Model, record: Dataset, name: Name) -> Gain:
    """Gain of the effect (site, driver) over the model with its background alone.

    The background is that of the plain fit, and then that found beside the effect where this is better. Both models
    may have either, so that the gain is of the effect and not of a better background.
    """
    adapted = model.expand_parameters([p.name for p in model.parameters if p.role == "estimated"])
    state = State(model, adapted, None, None, 1, lambda stage: None, Screening(record, (), ()))
    for stage in STAGES:
        outcome = stage(state)
        if isinstance(outcome, Verdict):
            return Gain(float("nan"), float("nan"))
        state = outcome
    problem, base = state.fitted
    alone, given = _cost(problem, base), _given(problem, base, state.responses, name)
    if given is None:
        return Gain(float("nan"), float("nan"))
    best, rows_each = _cost(problem, given), rows_per_effective_sample(problem, base, given)
    again = None
    if problem.background is not None and state.responses is not None:
        again = renewed(problem, base, given, feeds_unseen(problem, state.responses))
    if again is not None:
        problem, base = again
        alone = min(alone, _cost(problem, base))
        if (given := _given(problem, base, None, name)) is not None:
            best = min(best, _cost(problem, given))
    return Gain(alone - best, rows_each)


def _given(problem: Problem, base: Fit, responses: Responses | None, name: Name) -> Fit | None:
    """The best fit of one effect; None where the catalogue does not have it, or it can not be simulated."""
    scorer = scorer_of(problem, base, responses)[0]
    wanted = [s for s in scorer.scores() if s.candidate.name == name]
    fitted = refit(Fitter(problem), base, [ScoredLinearisation(scorer, wanted)])[0] if wanted else []
    return min((a.fit for a in fitted), key=lambda fit: fit.bic, default=None)


def _cost(problem: Problem, fit: Fit) -> float:
    background = problem.background
    numbers = 0 if background is None else Spread(background.course, background.constants, 0.0).numbers
    return cost(problem, fit, numbers)


def limit_of(job: tuple[Path, str]) -> dict[str, object] | None:
    """One row of the table for a record (folder, name); None for a record without an effect."""
    folder, record = job
    answer = json.loads((folder / "answers" / f"{record}.json").read_text())
    if not answer["effects"]:
        return None
    (effect,) = answer["effects"]
    model = replace(read_model("flotation")[0], record_code=True)
    measured = read_measurements(folder / "records" / f"{record}.csv", model).record
    gain = gain_of(model, measured, (effect["site"], effect["driver"]))
    return {
        "record": record,
        "truth": f"{effect['site']}:{effect['driver']}",
        "size": round(max(answer["size"].values()), 2),
        "loop": answer["loop"],
        "gain": round(gain.bic, 1),
        "rows_each": round(gain.rows_each, 2),
        "visible": gain.visible,
    }


def summary(table: pd.DataFrame) -> str:
    """How many effects are visible, in words."""
    return f"{int(table.visible.sum())} of {len(table)} effects gain enough to be told when they are given"
