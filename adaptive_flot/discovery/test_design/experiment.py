"""Which input moves would tell the leading alternatives apart: the test with the largest separation is chosen.

Each test is simulated with the models that were fitted (see `separation`), and judged by its *closest* pair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from adaptive_flot.discovery.assessment.verification import SURE
from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.search.alternatives import Alternative
from adaptive_flot.discovery.test_design.separation import predictions, separation
from adaptive_flot.discovery.test_design.signals import WATCHING, candidate_tests, input_range, watching
from adaptive_flot.greybox.model import FloatArray

TEST_ROWS = 900
CLOSE = 30.0
"""A rival whose criterion is worse by less is worth a test even when the verdict names."""
MOST_COMPARED = 4

Names = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Pair:
    """Two alternatives by their names, and what a test would separate them by."""

    one: Names
    other: Names
    separation: float


@dataclass(frozen=True)
class Tried:
    """A test in words, and the separation of its closest pair."""

    name: str
    separation: float


@dataclass(frozen=True)
class Experiment:
    """A test that would tell alternatives apart, if any of those tried does.

    Attributes
    ----------
    name
        The test in words.
    dt
        Length of an interval [s].
    inputs
        Inputs (N, nu) held in each interval.
    quantities
        Name and unit of each input.
    predicted
        Outputs (N, m) that each compared alternative predicts, in their order.
    compared
        The alternatives by their names.
    noise
        Standard deviation of the noise of each output (m,).
    pairs
        Separation of every pair, the closest first.
    tried
        Every test, best first; "no move" is what watching alone would tell.
    needed
        Separation from which the verdict would tell two apart.
    """

    name: str
    dt: float
    inputs: FloatArray
    quantities: tuple[tuple[str, str], ...]
    predicted: tuple[FloatArray, ...]
    compared: tuple[Names, ...]
    noise: FloatArray
    pairs: tuple[Pair, ...]
    tried: tuple[Tried, ...]
    needed: float

    @property
    def tells(self) -> bool:
        """Whether it separates every pair by more than the verdict needs."""
        return self.pairs[0].separation >= self.needed

    def moves(self) -> list[tuple[float, FloatArray]]:
        """(time since the start of the test [s], inputs (nu,) from then on) of each move."""
        changed = np.flatnonzero(np.any(np.diff(self.inputs, axis=0) != 0, axis=1)) + 1
        return [(float(k * self.dt), self.inputs[k]) for k in (0, *changed)]

    def __str__(self) -> str:
        closest = self.pairs[0]
        said = "A test that would tell" if self.tells else "No test tried would tell them all apart; the best"
        said += f": {self.name}, {self.dt * len(self.inputs):g} s"
        return (
            f"{said}. The closest two, {_words(closest.one)} and {_words(closest.other)}, would then differ by about "
            f"{closest.separation:.0f} in their criterion; {self.needed:.0f} is the least that tells two apart, and "
            f"watching without a move would give {self.watching:.0f}."
        )

    @property
    def watching(self) -> float:
        """Separation of the closest pair when nothing is moved."""
        return next((t.separation for t in self.tried if t.name == WATCHING), float("nan"))

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""
        names = [f"{name} [{unit}]" for name, unit in self.quantities]

        def pairs(found: Names) -> list[dict[str, str]]:
            return [{"site": s, "driver": d} for s, d in found]

        return {
            "test": self.name,
            "duration_s": self.dt * len(self.inputs),
            "tells_apart": self.tells,
            "separation_needed": round(self.needed, 1),
            "moves": [{"time_s": t, **{n: float(v) for n, v in zip(names, u, strict=True)}} for t, u in self.moves()],
            "pairs": [
                {"one": pairs(p.one), "other": pairs(p.other), "separation": round(p.separation, 1)} for p in self.pairs
            ],
            "tried": [{"test": t.name, "separation_of_closest": round(t.separation, 1)} for t in self.tried],
        }


def plan_experiment(
    problem: Problem,
    alternatives: Sequence[Alternative],
    needed: float,
    limits: Mapping[str, tuple[float, float]] | None = None,
    processes: int = 1,
) -> Experiment | None:
    """Choose among steps, square waves and binary sequences the test that separates the leading alternatives best.

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

    Returns
    -------
    Experiment or None
        None with fewer than two alternatives, without an input that may move, or when no test can be simulated.

    Raises
    ------
    ModelError
        A limit that does not fit the model's inputs.
    """
    compared = tuple(alternatives[:MOST_COMPARED])
    if len(compared) < 2:
        return None
    quantities = compared[0].fit.model.inputs
    where = input_range(problem.record.inputs, quantities, limits)
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
    closest = np.where(np.isfinite(table).all(axis=1), table.min(axis=1), -np.inf)
    order = [int(k) for k in np.argsort(-closest, kind="stable") if np.isfinite(closest[k])]
    moved = [k for k in order if k != len(tests) - 1]
    if not moved:
        return None
    best = moved[0]
    found = [Pair(compared[a].names, compared[b].names, float(d)) for (a, b), d in zip(pairs, table[best], strict=True)]
    return Experiment(
        tests[best].name,
        problem.record.dt,
        tests[best].inputs,
        tuple((q.name, q.unit) for q in quantities),
        tuple(run[best].outputs for run in runs),
        tuple(a.names for a in compared),
        noise.stationary_std() * np.median(problem.weights, axis=0),
        tuple(sorted(found, key=lambda pair: pair.separation)),
        tuple(Tried(tests[k].name, float(closest[k])) for k in order),
        needed,
    )


def _words(names: Names) -> str:
    return " with ".join(f"{site} by {driver}" for site, driver in names)


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
