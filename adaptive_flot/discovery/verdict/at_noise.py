"""The stage in which a record whose errors are noise is said to be explained, where no name is told."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.record.robust import AT_NOISE, memory, without_memory
from adaptive_flot.discovery.results import Judgement, State
from adaptive_flot.discovery.results.words import rough

MOST_MEMORY = 0.3
"""Correlation of neighbouring errors above which they are no noise from row to row.

Differences of what moves fast look like noise. A model that lacks this errs with a memory.
"""

EXPLAINED = (
    "The model explains the record: its errors are the noise from row to row. "
    "What else is there is too small to be told."
)


def none_at_noise(state: State) -> State:
    """Say `none` instead of `abstain` where the model as it is errs by the noise from row to row.

    On many rows an effect may be sure that makes errors 2 % smaller, and several explain it. A healthy thickener was
    told to lack something by that. A note says by how much the best one is better.
    """
    judgement, (before, _) = state.judged, state.refitted
    problem, result = state.searched
    if judgement.word != "abstain" or not state.error or any(c.noise <= 0 for c in state.error):
        return state
    errors = before.residual(problem)
    small, noise = memory(errors) <= MOST_MEMORY, without_memory(errors, problem.measured)
    names = [before.model.outputs[c].name for c in problem.columns]
    for c in state.error:
        j = names.index(c.output)
        if not noise[j] and not (small[j] and c.before <= AT_NOISE * c.noise):
            return state
    notes = state.screening.notes
    if judgement.best is not None:
        best = " with ".join(f"{site} by {driver}" for site, driver in judgement.best.names).replace("_", " ")
        share = 100 * max(max(1 - c.after / c.before for c in state.error if c.before > 0), 0.0)
        notes = (
            *notes,
            f"of what was tried, {best} explains most: an error is {rough(share)} % smaller with it, at most",
        )
    return replace(
        state,
        judgement=Judgement("none", None, (), judgement.rivals, judgement.margin),
        search=replace(result, verification=None),  # of what was not told
        after=before,
        screening=replace(state.screening, notes=notes),
        error=tuple(replace(c, after=c.before, reduction95=(0.0, 0.0)) for c in state.error),
        sentence=EXPLAINED,
        contradiction="",
        certain="",
    )
