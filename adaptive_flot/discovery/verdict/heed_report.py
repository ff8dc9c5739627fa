"""The stage in which the report rows have their say: errors before and after, and a name that they contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.beside_background import drop_beside_background, unknown_of_background
from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE, rows_per_effective_sample
from adaptive_flot.discovery.assessment.verification import changes
from adaptive_flot.discovery.background.fitting import taken_up
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import Judgement, OutputChange, State
from adaptive_flot.discovery.verdict.conclude import report_errors
from adaptive_flot.discovery.verdict.judge import constants_told
from adaptive_flot.discovery.verdict.outputs import certain_words
from adaptive_flot.discovery.verdict.report_veto import (
    contradiction,
    contradiction_at_the_end,
    explains_little,
    last_report_rows,
    noise_from_row_to_row,
    surely_better,
    unexplained,
)
from adaptive_flot.greybox.model import FloatArray


def heed_report(state: State) -> State:
    """Take a name back where the held-out rows contradict it."""
    problem, (before, after), judgement = state.known_problem, state.refitted, state.judged
    beside = state.problem_after or problem
    error = report_errors(problem, before, after, state.report_record)
    noise = noise_from_row_to_row(problem, before.model, error, state.report_record)
    unknown = limit = np.zeros(len(error))
    likelier = 0.0
    if state.report_record is None:
        names = [after.model.outputs[c].name for c in problem.columns]
        shown = [names.index(c.output) for c in error]
        unknown, limit = (v[shown] for v in unknown_of_background(beside, after, ("estimate", "confirm"), "report"))
        if judgement.word in ("named", "class"):
            likelier = drop_beside_background(problem, before, after, "report", beside)
            likelier /= rows_per_effective_sample(problem, before, after)
    surely = likelier > LEAST_EVIDENCE
    alike = taken_up(problem, constants_told(judgement))
    against = contradiction(judgement, error, with_memory(problem, error, noise), limit, surely, alike)
    if not against and state.report_record is None:
        against = _at_the_end(judgement, problem, beside, before, after, surely)
    if not against and judgement.word in ("named", "class"):
        against = explains_little(error, np.hypot(noise, unknown))
    if against:
        judgement = replace(judgement, word="abstain", members=(), part=())
    certain = certain_words(judgement, error, noise) if judgement.word == "abstain" else ""
    if judgement.word == "none" and (left := unexplained(error, np.hypot(noise, unknown))):
        judgement, certain = Judgement("abstain", None, (), judgement.rivals, judgement.margin), left
    told = likelier if surely and not against and not surely_better(error) else 0.0
    return replace(state, error=error, judgement=judgement, likelihood=told, contradiction=against, certain=certain)


def _at_the_end(
    judgement: Judgement, problem: Problem, beside: Problem, before: Fit, after: Fit, likelier: bool
) -> str:
    """What the last report rows say against a free curve in time at a sensor; `beside` is the problem of `after`."""
    last = last_report_rows(problem)
    error = changes(last, before, after, "report")
    names = [after.model.outputs[c].name for c in problem.columns]
    noise = with_memory(last, error, noise_from_row_to_row(last, before.model, error))
    if not likelier:
        return contradiction_at_the_end(judgement, error, noise)
    own = replace(beside, splits=last.splits)
    limit = unknown_of_background(own, after, ("estimate", "confirm"), "report")[1]
    return contradiction_at_the_end(judgement, error, noise, limit[[names.index(c.output) for c in error]])


def with_memory(problem: Problem, error: Sequence[OutputChange], noise: FloatArray) -> FloatArray:
    """The noise of each output; beside a background with the memory that the fit gives it, where that is more.

    Differences from row to row show sqrt(1 - rho) of noise whose neighbours have a correlation rho. An output at its
    noise would be wrong then, whichever name is told. Without a background, noise with a memory may be what is missing.
    """
    return noise if problem.background is None else np.maximum(noise, [c.noise for c in error])
