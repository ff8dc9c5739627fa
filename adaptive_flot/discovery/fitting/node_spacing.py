"""How far apart a search may simulate a densely sampled record without anyone noticing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fitting.descent import nodes_for
from adaptive_flot.discovery.fitting.fit import Fit, loss_of
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.graded_nodes import graded_nodes
from adaptive_flot.greybox.stepping.nodes import Nodes, place_nodes, rows_between_moves, substeps
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED, Stepper

LONGEST = (6, 4, 3, 2)
"""Most rows from node to node, or steps at every row in one, that are tried."""
FIRST_STEPS = (4, 6, 8, 12)
"""Steps in the interval after a move of a coarsely sampled record, where a row asks for many."""
AT_REST = ((2, 0.2), (4, 0.2), (6, 0.1))
"""Most rows of a step at rest in such a record, and by how many rows a row steps grow."""
GROWTHS = (1.0, 0.5, 0.35, 0.25)
"""Rows that nodes may be further apart for each row since the last move of an input: what a move sets off dies away."""
UNNOTICED = 2.0
"""Sum of the squared errors of the coarser run, in standard deviations of the noise, that makes no difference: it
changes minus two log-likelihood by about as much, a fifth of what a name asks for."""
NOTICED = 3.0
"""Difference of minus two log-likelihood from which a run at every row is worth its price."""
WORTHWHILE = 0.8
"""Nodes as a share of the steps at every row above which there is nothing to save."""


def at_every_row(fitter: Fitter, fit: Fit, bounds: Mapping[str, tuple[float, float]]) -> Fit:
    """The fit itself where a run at every row says the same of it; else one made at every row, from there.

    The nodes were placed for the model as it is: an effect may have made it faster.
    """
    problem = fitter.problem
    if nodes_for(problem, fit.model) is None or _says_the_same(fitter, fit, None):
        return fit
    every = Fitter(replace(problem, nodes=None), fitter.splits)
    return every.fit(fit.model, fit.names, like=fit, bounds=bounds, rounds=2) or fit


def fitter_about(fitter: Fitter, fit: Fit) -> Fitter:
    """The fitter for a comparison with a fit: one at every row where a run at its nodes does not say the same of it.

    Such a fit was made at every row, and one at nodes would look worse than it is beside it.
    """
    nodes = nodes_for(fitter.problem, fit.model)
    if nodes is None or _says_the_same(fitter, fit, nodes):
        return fitter
    return Fitter(replace(fitter.problem, nodes=None), fitter.splits)


def _says_the_same(fitter: Fitter, fit: Fit, nodes: Nodes | None) -> bool:
    """Whether a run at nodes, or at every row, differs from a fit by less than NOTICED."""
    problem = fitter.problem
    run = RecordSimulator(fit.model, problem.record.dt, nodes)
    free = run.outputs(problem.record, fit.initial_state, fit.model.parameter_values)[:, problem.columns]
    if problem.background is not None:
        free = free + problem.background.outputs(fit.background, fit.model)
    own = fit.loss if problem.background is None else loss_of(problem, fit.predicted, fitter.rows)[0]
    return bool(np.isfinite(free).all()) and abs(loss_of(problem, free, fitter.rows)[0] - own) < NOTICED


def placements(record: Dataset, model: Model) -> list[Nodes]:
    """Nodes that are tried, the fewest first; of a coarsely sampled record longer steps, where a row asks for many."""
    steps = Stepper(model, record.dt).substeps
    if steps > MOST_UNROLLED:
        parted: list[Nodes] = [substeps(record, count) for count in {math.ceil(steps / longest) for longest in LONGEST}]
        for first in FIRST_STEPS:
            every = graded_nodes(record, first)
            parted += [every, graded_nodes(record, first, least=2)]
            parted += [graded_nodes(record, first, 1, *rest, every_row=every) for rest in AT_REST]
        return sorted(parted, key=lambda nodes: len(nodes.rows))
    ways = [(longest, growth) for longest in LONGEST for growth in GROWTHS]
    counts = {each: sum(map(len, rows_between_moves(record, *each))) for each in ways}
    fewest_first = sorted(ways, key=lambda each: counts[each])
    return [place_nodes(record, *each) for each in fewest_first if counts[each] <= WORTHWHILE * len(record)]


def with_nodes(problem: Problem, fit: Fit, placed: Sequence[Nodes] | None = None) -> Problem:
    """The problem with the first `placements` at which a fit's run stays what it is at every row, if there are any."""
    record, every = problem.record, replace(problem, nodes=None)
    run = RecordSimulator(fit.model, record.dt)
    exact = run.outputs(record, fit.initial_state, fit.model.parameter_values)[:, problem.columns]
    noise = noise_by_differences((problem.measured - exact) / problem.weights)
    size = np.maximum(np.nan_to_num(noise), problem.floor) * problem.weights
    for nodes in placements(record, fit.model) if placed is None else placed:
        run = RecordSimulator(fit.model, record.dt, nodes)
        free = run.outputs(record, fit.initial_state, fit.model.parameter_values)[:, problem.columns]
        with np.errstate(over="ignore", invalid="ignore"):  # a longer step may run off
            noticed = float(np.sum(((free - exact) / size) ** 2))
        if noticed < UNNOTICED:
            return replace(problem, nodes=nodes)
    return every
