"""Before the search: the record in splits, and the fit of the model as it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats.qmc import Halton

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import placements, with_nodes
from adaptive_flot.discovery.record.noise import proportional
from adaptive_flot.discovery.record.noise_level import noise_changes, noise_levels
from adaptive_flot.discovery.record.problem import CYCLES, Problem, make_problem, split_names
from adaptive_flot.discovery.record.robust import noise_beside_motion
from adaptive_flot.discovery.record.screening import Screening
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.record import RecordSimulator

BURN_IN_ROWS = 30
GUARD_ROWS = 5
FEWEST_VALUES = 8
"""An output with fewer measurements on any split is left out: it could not be fitted, confirmed or reported."""
MUCH = 3.0
"""A fit whose error is so many times the noise may rest in a side minimum."""
STARTS, SPREAD, WIDTH = 8, 0.3, 3.0
"""Further starts, how far they spread in the logarithm of a constant, and in scales of one that may be negative."""
ELSEWHERE = 10.0
"""Least drop of minus two log-likelihood for which another start is taken."""


def split_record(
    checked: Screening, model: Model, adapted: tuple[str, ...], cycle: Sequence[str]
) -> tuple[Problem, Screening]:
    """The record split into parts, and what the screening says with the outputs that one of them does not see."""
    record = checked.record
    burn_in = min(BURN_IN_ROWS, len(record) // 20)
    problem = make_problem(record, model, adapted, burn_in=burn_in, guard=GUARD_ROWS, cycle=cycle)
    counts = np.array([np.isfinite(problem.measured[problem.rows(split)]).sum(axis=0) for split in cycle])
    enough = counts.min(axis=0) >= FEWEST_VALUES
    left = tuple(
        f"{model.outputs[c].name}: too few values in a part of the record, left out"
        for c, is_enough in zip(problem.columns, enough, strict=True)
        if not is_enough
    )
    columns = tuple(np.array(problem.columns)[enough].tolist())
    kept = replace(problem, columns=columns, weights=problem.weights[:, enough], floor=problem.floor[enough])
    reasons = () if columns else ("no output is measured throughout the record",)
    return kept, replace(checked, reasons=reasons, notes=checked.notes + left)


def split_finer(problem: Problem, cycle: Sequence[str], least_rows: int) -> Problem:
    """The same problem with more and shorter splits, of at least so many rows each; as it is where that is none."""
    cycles = (len(problem.record) - problem.first_row) // (len(cycle) * least_rows)
    if cycles <= CYCLES:
        return problem
    splits = split_names(len(problem.record), problem.first_row, GUARD_ROWS, cycles, cycle)
    counts = [np.isfinite(problem.measured[splits == name]).sum(axis=0) for name in cycle]
    return replace(problem, splits=splits) if np.min(counts) >= FEWEST_VALUES else problem


def prepare(problem: Problem, model: Model) -> tuple[Problem, Fit] | None:
    """Fit the model as it is, twice: the first residual shows how the noise grows, and whether it changes.

    Rows that make no difference are left out of the runs: first to the model as it came, then to the first fit.
    """
    start = Fitter(problem).fit(model, rounds=0)
    if start is None:
        return None
    placed = placements(problem.record, model)
    problem = with_nodes(problem, start, placed)
    first = Fitter(problem).fit(model, like=start, rounds=1)
    if first is not None and not _runs_at_every_row(problem, first):
        problem = replace(problem, nodes=None)  # long steps led the search to where the model itself does not run
        first = Fitter(problem).fit(model, like=start, rounds=1)
    if first is None:
        return None
    first = _from_elsewhere(problem, start, first)
    seen = np.where(problem.rows("estimate")[:, None], first.residual(problem), np.nan)
    weights = proportional(seen, first.predicted)
    changes = noise_changes(seen / weights)
    problem = replace(problem, weights=weights * noise_levels(changes, *weights.shape), noise_changes=changes)
    problem = with_nodes(problem, first, placed)
    fitter = Fitter(problem)
    base = fitter.fit(first.model, like=first, rounds=2)
    if base is None:
        return None
    return problem, fitter.settled(base)


def _from_elsewhere(problem: Problem, start: Fit, first: Fit) -> Fit:
    """The best of fits from several constants, where one leaves much of a process that does not start at rest.

    A stiffness 12 % off puts an oscillator out of step, and its fit stays in a side minimum. The constants are those
    of the model times e^(SPREAD x), or plus WIDTH x scales where they may be negative, x a Halton sequence about 0.
    """
    rows, model = problem.rows("estimate"), start.model
    noise = np.maximum(noise_beside_motion(problem.measured), problem.floor)
    left = np.sqrt(np.nanmean(first.residual(problem)[rows] ** 2, axis=0))
    if model.starts_steady or not problem.adapted or not np.any(left > MUCH * noise):
        return first
    chosen = [model.parameters[i] for i in model.indices("parameters", problem.adapted)]
    fits = [first]
    for x in 2 * Halton(len(chosen), scramble=False).random(STARTS + 1)[1:] - 1:
        away = [
            p.value * np.exp(SPREAD * v) if p.lower >= 0 else p.value + WIDTH * v * p.scale
            for p, v in zip(chosen, x, strict=True)
        ]
        values = {p.name: float(np.clip(value, p.lower, p.upper)) for p, value in zip(chosen, away, strict=True)}
        fit = Fitter(problem).fit(model, start=values, like=start, rounds=1)
        fits += [fit] if fit is not None and _runs_at_every_row(problem, fit) else []
    best = min(fits, key=lambda f: f.loss)
    return best if best.loss < first.loss - ELSEWHERE else first


def _runs_at_every_row(problem: Problem, fit: Fit) -> bool:
    """Whether the model runs with what the fit came to when it is simulated at every row."""
    run = RecordSimulator(fit.model, problem.record.dt)
    return bool(np.isfinite(run.outputs(problem.record, fit.initial_state, fit.model.parameter_values)).all())
