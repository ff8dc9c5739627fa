"""The stage in which a record whose errors are noise is said to be explained, where no name is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.results import Judgement, State
from adaptive_flot.greybox.model import FloatArray

AT_NOISE = 1.1
"""Errors of at most so many times the noise from row to row are that noise."""
MOST_MEMORY = 0.3
"""Correlation of neighbouring errors above which they are no noise from row to row.

Differences of what moves fast look like noise. A model that lacks this errs with a memory.
"""

FEWEST_PAIRS = 3
EXPLAINED = "The model explains the record: its errors are the noise from row to row"


def none_at_noise(state: State) -> State:
    """Say `none` instead of `abstain` where the model as it is errs by the noise from row to row.

    On many rows an effect may be sure that makes errors 2 % smaller, and several explain it. A healthy thickener was
    told to lack something by that. A note says by how much the best one is better.
    """
    judgement, (before, _) = state.judged, state.refitted
    problem = state.known_problem
    if judgement.word != "abstain" or not state.error or any(c.noise <= 0 for c in state.error):
        return state
    times = max(c.before / c.noise for c in state.error)
    if times > AT_NOISE or np.max(memory(before.residual(problem))) > MOST_MEMORY:
        return state
    notes = state.screening.notes
    if judgement.best is not None:
        best = " with ".join(f"{site} by {driver}" for site, driver in judgement.best.names).replace("_", " ")
        share = 100 * max(max(1 - c.after / c.before for c in state.error if c.before > 0), 0.0)
        notes = (*notes, f"of what was tried, {best} explains most: an error is {share:.2g} % smaller with it, at most")
    return replace(
        state,
        judgement=Judgement("none", None, (), judgement.rivals, judgement.margin),
        after=before,
        screening=replace(state.screening, notes=notes),
        error=tuple(replace(c, after=c.before, reduction95=(0.0, 0.0)) for c in state.error),
        sentence=f"{EXPLAINED} ({times:.2g} times at most).",
        contradiction="",
        certain="",
    )


def memory(errors: FloatArray) -> FloatArray:
    """Correlation of neighbouring errors of each output (m,); zero where fewer than three pairs have both.

    With errors e of mean zero at the rows k where both are there::

        sum_k e_k e_(k+1) / sqrt(sum_k e_k^2  sum_k e_(k+1)^2)
    """
    found = np.zeros(errors.shape[1])
    for j, e in enumerate(errors.T):
        one, other = e[:-1], e[1:]
        both = np.isfinite(one) & np.isfinite(other)
        size = np.sqrt(np.sum(one[both] ** 2) * np.sum(other[both] ** 2))
        if np.count_nonzero(both) >= FEWEST_PAIRS and size > 0:
            found[j] = np.sum(one[both] * other[both]) / size
    return found
