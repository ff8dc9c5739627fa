"""The rows that say anything of an event that passes: elsewhere two models predict the same, and no error can differ.

A pulse of some minutes lies in a few blocks of a long record. Whether it is real is a question to these. Blocks drawn
from all rows would hold it in some draws and not in others, and so no interval could ever exclude that it does nothing.

Where an edge lies between two fitted rows, the rows there may be before or after it. What they say is when it came, and
not whether. So they do not count, unless no others are there: then the event is asked for more than it can know.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator

DIFFERS = 0.5
"""What changes no output by more than so many standard deviations of the noise changes nothing."""
LITTLE = 0.1
"""Share of the largest change below which a row says little of an event."""
BY_CHANCE = 0.95
"""Share of records in which noise stays below what counts as its largest by chance."""
LEAST_ROWS = 16
"""Least rows for an interval: four of the shortest blocks."""


def telling_rows(problem: Problem, fits: Sequence[Fit], split: str, fitted: Sequence[str] = ()) -> BoolArray:
    """Rows (N,) of a split on which a pulse of some fits changes an output; all of them, unless only pulses differ.

    The rows beside an edge are left out (see above) where the split is none of those that were `fitted`. A pulse that
    the model came with is no question to the record, and another effect acts on all rows.

    Parameters
    ----------
    problem, fits
        The record, and the fits that are compared.
    split, fitted
        Name of the split that is asked, and names of those that the fits have seen.
    """
    found = [e for fit in fits for e in fit.model.fitted_effects() if _is_free(fit, e)]
    if not all(e.family.passes for e in found):
        return problem.rows(split)
    return pulse_rows(problem, fits, split, fitted, touched_rows(problem, fits))


def pulse_rows(
    problem: Problem, fits: Sequence[Fit], split: str, fitted: Sequence[str], touched: BoolArray
) -> BoolArray:
    """Rows (N,) as in `telling_rows`, whatever else differs; `touched` is what `touched_rows` gives for these fits."""
    there: BoolArray = problem.rows(split) & touched
    sure: BoolArray = there & ~_beside_an_edge(problem, [pulse for _, pulse in _pulses(fits)], fitted)
    return sure if sure.sum() >= LEAST_ROWS else there


def touched_rows(problem: Problem, fits: Sequence[Fit], split: str | None = None) -> BoolArray:
    """Rows (N,) on which a pulse of some fits changes a measured output; all, where none has one.

    With a split: rows on which it does so by LITTLE of the most there. Where an effect dies away, rows say less of it.
    """
    masks = [_touched(problem, fit, pulse, split) for fit, pulse in _pulses(fits)]
    return np.any(masks, axis=0) if masks else np.ones(len(problem.record), dtype=bool)


def _pulses(fits: Sequence[Fit]) -> list[tuple[Fit, Effect]]:
    """Pulses that some fits have found."""
    return [(fit, e) for fit in fits for e in fit.model.fitted_effects() if e.family.passes and _is_free(fit, e)]


def _is_free(fit: Fit, effect: Effect) -> bool:
    return any(effect.parameter(c.name) in fit.names for c in effect.terms)


def _beside_an_edge(problem: Problem, pulses: Sequence[Effect], fitted: Sequence[str]) -> BoolArray:
    """Rows (N,) between an edge and the nearest rows that were fitted; none where no split was."""
    beside = np.zeros(len(problem.record), dtype=bool)
    asked = np.flatnonzero(problem.rows(*fitted)) if fitted else np.arange(len(beside))
    for edge in (t for pulse in pulses for t in edges(pulse)):
        row = int(np.searchsorted(problem.record.time, edge))
        before, after = asked[asked < row], asked[asked >= row]
        beside[before[-1] + 1 if before.size else 0 : after[0] if after.size else len(beside)] = True
    return beside


def _touched(problem: Problem, fit: Fit, pulse: Effect, split: str | None) -> BoolArray:
    """Rows (N,) on which a pulse changes a measured output; see `touched_rows`."""
    record, columns = problem.record, list(problem.columns)
    simulator = RecordSimulator(fit.model, record.dt)
    without = dict.fromkeys(map(pulse.parameter, pulse.names(CoefficientRole.LEVEL)), 0.0)
    runs = [
        simulator.outputs(record, fit.initial_state, model.parameter_values)[:, columns]
        for model in (fit.model, fit.model.with_parameters(without))
    ]
    size = problem.weights * fit.noise.stationary_std()
    change = np.max(np.abs(runs[0] - runs[1]) / size, axis=1)
    most = 0.0 if split is None else float(np.max(change[problem.rows(split)], initial=0.0))
    touched: BoolArray = change > max(DIFFERS, LITTLE * most)
    return touched


def edges(pulse: Effect) -> tuple[float, ...]:
    """Times [s] at which a pulse comes and goes."""
    onsets, lengths = pulse.values(CoefficientRole.ONSET), pulse.values(CoefficientRole.DURATION)
    return tuple(t for begin, length in zip(onsets, lengths, strict=True) for t in (begin, begin + length))


def largest_by_chance(noise: Noise, rows: int) -> FloatArray:
    """Root mean square (m,) that noise exceeds over so many rows once in twenty times, in its standard deviations.

    Squares of noise whose neighbours have the correlation rho are worth n of the N rows, and so their mean is close to
    chi-squared with n degrees of freedom over n::

        n / N = (1 - rho^2) / (1 + rho^2)

    Bayley & Hammersley, *J. R. Statist. Soc. Suppl.* 8 (1946) 184, for the squares.
    """
    square = 1 - (noise.std / noise.stationary_std()) ** 2
    freedom = np.maximum(rows * (1 - square) / (1 + square), 1.0)
    largest: FloatArray = np.sqrt(chi2.ppf(BY_CHANCE, freedom) / freedom)
    return largest


def on_telling_rows(problem: Problem, before: Fit, after: Fit, split: str, fitted: Sequence[str]) -> Problem:
    """The problem whose split of that name has only its telling rows; as it is where these are all."""
    return _with_rows(problem, split, telling_rows(problem, (before, after), split, fitted))


def off_the_edges(problem: Problem, fit: Fit, split: str, fitted: Sequence[str]) -> Problem:
    """The problem whose split of that name has no rows beside an edge of a pulse, that could not know when it came."""
    pulses = [pulse for _, pulse in _pulses([fit])]
    return _with_rows(problem, split, problem.rows(split) & ~_beside_an_edge(problem, pulses, fitted))


def _with_rows(problem: Problem, split: str, wanted: BoolArray) -> Problem:
    others = problem.splits != split
    if (wanted | others).all():
        return problem
    return replace(problem, splits=np.where(wanted | others, problem.splits, ""))
