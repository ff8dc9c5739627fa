"""Which input moves would tell the leading alternatives apart: the test with the largest separation is chosen.

Each test is simulated with the models that were fitted (see `separation`), and judged by its *closest* pair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.results import SURE, Alternative, Experiment, Pair, Tried
from adaptive_flot.discovery.test_design.power import power
from adaptive_flot.discovery.test_design.separation import predictions, separation, stays_near
from adaptive_flot.discovery.test_design.signals import candidate_tests, input_range, watching
from adaptive_flot.parallel import parallel_map

TEST_ROWS = 900
CLOSE = 30.0
"""A rival whose criterion is worse by less is worth a test even when the verdict names."""
MOST_COMPARED = 4


def plan_experiment(
    problem: Problem,
    alternatives: Sequence[Alternative],
    needed: float,
    limits: Mapping[str, tuple[float, float]] | None = None,
    processes: int = 1,
    held: Mapping[str, str] | None = None,
) -> Experiment | None:
    """Choose among steps, square waves and binary sequences the test that separates the leading alternatives best.

    ::

        max over tests u of min over pairs (a, b) of separation(a, b; u)

    A T-optimal design, with the parameters as they were fitted: Atkinson & Fedorov, *Biometrika* 62 (1975) 57 (two
    models) and 289 (several). `separation` also counts what uncertain parameters could hide.

    Parameters
    ----------
    problem
        The record: where its inputs have been, and when its outputs are measured.
    alternatives
        Fitted alternatives, best first; the test goes on from where each of them ends.
    needed
        Separation from which two count as told apart.
    limits
        Ranges of inputs by name, where they are not those of the record.
    processes
        Alternatives that are simulated at once.
    held
        Inputs that must not be moved, by name, and why.

    Returns
    -------
    Experiment or None
        None with fewer than two alternatives, without an input that may move, when no test can be simulated, or when by
        some alternative each would bring an output where the process has never been (`stays_near`).

    Raises
    ------
    ModelError
        A limit that does not fit the model's inputs.
    """
    compared = tuple(alternatives[:MOST_COMPARED])
    if len(compared) < 2:
        return None
    quantities = compared[0].fit.model.inputs
    where = input_range(problem.record.inputs, quantities, limits).without_moves(
        [j for j, q in enumerate(quantities) if held and q.name in held]
    )
    rows = min(TEST_ROWS, len(problem.record) - 1)
    tests = [*candidate_tests([q.name for q in quantities], where, rows), watching(problem.record.inputs[-1], rows)]
    if len(tests) == 1:
        return None
    noise = compared[0].fit.noise
    signals = [t.inputs for t in tests]
    runs = parallel_map(
        lambda k: predictions(problem, compared[k].fit, noise, signals), range(len(compared)), processes
    )
    pairs = list(combinations(range(len(compared)), 2))
    table = np.array([[separation(runs[a][k], runs[b][k]) for a, b in pairs] for k in range(len(tests))])
    stays = np.array(
        [all(stays_near(problem, compared[0].fit.model, run[k].outputs) for run in runs) for k in range(len(tests))]
    )
    closest = np.where(np.isfinite(table).all(axis=1) & stays, table.min(axis=1), -np.inf)
    order = [int(k) for k in np.argsort(-closest, kind="stable") if np.isfinite(closest[k])]
    moved = [k for k in order if k != len(tests) - 1 and stays[k]]
    if not moved:
        return None
    best = moved[0]
    separations = [
        Pair(compared[a].names, compared[b].names, float(d)) for (a, b), d in zip(pairs, table[best], strict=True)
    ]
    return Experiment(
        tests[best].name,
        problem.record.dt,
        tests[best].inputs,
        tuple((q.name, q.unit) for q in quantities),
        tuple(run[best].outputs for run in runs),
        tuple(a.names for a in compared),
        noise.stationary_std() * np.median(problem.weights, axis=0),
        tuple(sorted(separations, key=lambda pair: pair.separation)),
        tuple(Tried(tests[k].name, float(closest[k])) for k in order),
        needed,
        power([run[best] for run in runs], needed),
        tuple((held or {}).items()),
    )


def leading(best: Alternative, others: Sequence[Alternative], margin: float) -> tuple[Alternative, ...]:
    """Alternatives worth a test: the best, and the first few that come close to it."""
    seen = {frozenset(best.names)}
    close = [best]
    for a in others:
        if (
            abs(a.worse_than(best)) < max(margin, CLOSE, SURE * a.loglik_difference_sd)
            and frozenset(a.names) not in seen
        ):
            seen.add(frozenset(a.names))
            close.append(a)
    return tuple(close[:MOST_COMPARED])
