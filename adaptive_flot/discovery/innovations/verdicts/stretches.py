"""Errors on held-out stretches, each predicted from the state that the filter had before it.

The error of a free run over a whole record is mostly what has wandered in the process since its first row. So it hardly
tells whether an effect is there. A stretch of a tenth of the record holds less of that, and no row of it has fitted a
constant or a coefficient.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from adaptive_flot.discovery.assessment.reduction import reduction
from adaptive_flot.discovery.assessment.verification import BLOCK_ROWS
from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.discovery.innovations.filter.refit import Refitter
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.results import OutputChange
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper

OF_A_RECORD, SETTLING = 10, 20
"""Stretches of a whole record; share of its rows, the first ones, after which the filter knows the state."""


def errors_over_stretches(
    search: Search, before: Explanation, after: Explanation, held_out: BoolArray, report: Dataset | None = None
) -> tuple[OutputChange, ...]:
    """Root mean square error of each output over held-out stretches, by two explanations.

    Constants and coefficients are fitted anew to all other rows, with the noise as it is. The filter then goes over all
    rows. From its state on the row before, each stretch is simulated to its end.

    Parameters
    ----------
    search
        The record, its model and what is fitted.
    before, after
        Explanations to compare.
    held_out
        Rows of the search's record that are held out (N,): runs of them are the stretches.
    report
        A record of its own that is predicted instead, in ten stretches; then no row of the other is held out.
    """
    record = search.record if report is None else report
    if report is not None:
        held_out = np.zeros(len(search.record), dtype=bool)
        stretches = _tenths(len(report))
    else:
        inside = np.concatenate([[False], held_out, [False]]).astype(int)
        starts, ends = (np.flatnonzero(np.diff(inside) == sign) for sign in (1, -1))
        stretches = [(int(a), int(b)) for a, b in zip(np.maximum(starts, 1), ends, strict=True) if b > max(a, 1)]
    old, new = (_squares(search, e, ~held_out, record, stretches) for e in (before, after))
    return _changes(search, after, old, new)


def errors_over_folds(search: Search, before: Explanation, after: Explanation) -> tuple[OutputChange, ...]:
    """The same over each tenth of the record, in five folds of two tenths: all rows are held out once."""
    return _changes(search, after, _over_folds(search, before), _over_folds(search, after))


def usual_over_folds(search: Search, explanation: Explanation) -> dict[str, float]:
    """Root mean square error of each output over each tenth of the record, by one explanation, as above."""
    with np.errstate(all="ignore"):
        found = np.sqrt(np.nanmean(_over_folds(search, explanation), axis=0))
    return {search.model.outputs[c].name: float(e) for c, e in zip(search.columns, found, strict=True)}


def is_on(explanation: Explanation, time: FloatArray) -> BoolArray:
    """Rows in which an event of an explanation is on, by their times (N,) [s]."""
    on = np.zeros(len(time), dtype=bool)
    for h in explanation.hypotheses:
        for begin, long in h.pulses:
            on |= (time >= begin) & (time < begin + long)
    return on


def _over_folds(search: Search, explanation: Explanation) -> FloatArray:
    """Squared errors on all tenths, one below the other (rows, m)."""
    tenths, half = _tenths(len(search.record)), OF_A_RECORD // 2
    first, second = [], []
    for k in range(half):
        two = [tenths[k], tenths[k + half]]
        counted = np.ones(len(search.record), dtype=bool)
        for a, b in two:
            counted[a:b] = False
        squares = _squares(search, explanation, counted, search.record, two)
        length = two[0][1] - two[0][0]
        first.append(squares[:length])
        second.append(squares[length:])
    return np.concatenate([*first, *second])


def _tenths(n: int) -> list[tuple[int, int]]:
    """Ten stretches of n rows, less the first rows, in which the filter finds the state."""
    edges = np.linspace(max(n // SETTLING, 1), n, OF_A_RECORD + 1).astype(int).tolist()
    return list(pairwise(edges))


def _changes(search: Search, after: Explanation, old: FloatArray, new: FloatArray) -> tuple[OutputChange, ...]:
    found = []
    for j, c in enumerate(search.columns):
        a, b = old[:, j], new[:, j]
        if np.isfinite(a).any():
            q, noise = search.model.outputs[c], float(after.fit.noise.std(search.model)[c])
            error, less = (float(np.sqrt(np.nanmean(s))) for s in (a, b))
            found.append(OutputChange(q.name, q.unit, error, less, noise, reduction(a, b, BLOCK_ROWS)[1]))
    return tuple(found)


def _squares(
    search: Search, explanation: Explanation, counted: BoolArray, record: Dataset, stretches: list[tuple[int, int]]
) -> FloatArray:
    """Squared errors on the rows of the stretches, one below the other (rows, m)."""
    model, free = search.model_of(explanation), explanation.free
    names = (*search.free, *free)
    fitter = Refitter(model, search.record, search.columns, search.floor, names, search.known, counted)
    fit = fitter.fit(explanation.fit.p, explanation.fit.size, hold_noise=True)
    filtered = fit.filtered
    if record is not search.record:
        filtered = Refitter(model, record, search.columns, search.floor, names).run(fit.p, fit.noise)
    stepper, columns, found = Stepper(model, record.dt), list(search.columns), []
    for a, b in stretches:
        state = filtered.z[a - 1, : len(model.states)]
        run = stepper.simulate(state, record.inputs[a:b], fit.p, float(record.time[a - 1]))
        found.append((record.outputs[a:b][:, columns] - run.outputs[:, columns]) ** 2)
    return np.concatenate(found) if found else np.empty((0, len(columns)))
