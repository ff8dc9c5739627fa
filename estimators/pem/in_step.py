"""Searches of many records in step: each goes its own way, and all are simulated at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED
from estimators.pem.free_runs import MOST_EVALUATIONS, NOISE_CONVERGED, WEIGHT_PASSES, FreeRuns
from estimators.pem.free_runs_in_step import Batch, FreeRunsInStep, RunsInStep
from estimators.pem.problem import Problem, Search
from estimators.pem.trust_region import Mask, Squares, solve_in_step


def can_go_in_step(runs: FreeRuns, records: Sequence[Dataset]) -> bool:
    """Whether searches of records may go in step: as machine code, with the same times and the steps not too many."""
    model, first = runs.setup.model, records[0]
    if not model.compiled or compiler_problem() is not None or model.steps_in(runs.setup.dt) > MOST_UNROLLED:
        return False
    alike = all(r.inputs.shape == first.inputs.shape and np.array_equal(r.time, first.time) for r in records)
    return alike and len(first) > 1


class SearchesInStep:
    """The search of `FreeRuns.search` from the model's own values, for several records at once.

    Parameters
    ----------
    runs
        Those of one record.
    """

    def __init__(self, runs: FreeRuns) -> None:
        self._runs = runs
        self._in_step = FreeRunsInStep(runs.setup, runs.initial_state == "steady", runs.free)

    def problems(self, records: Sequence[Dataset]) -> list[Problem | Exception]:
        """The problem of each record, or why it has none."""
        starts: list[FloatArray | None] = [None] * len(records)
        if self._runs.starts_steady:
            found, good = self._in_step.steady_starts(records)
            starts = [x if ok else None for x, ok in zip(found, good, strict=True)]
        made = list[Problem | Exception]()
        for record, start in zip(records, starts, strict=True):
            try:
                made.append(self._runs.problem(record, start))
            except Exception as error:
                made.append(error)
        return made

    def search(self, records: Sequence[Dataset], problems: Sequence[Problem]) -> list[Search | None]:
        """Where the searches end; None for one that must go alone. Each problem then knows the run from its end."""
        least = _Least(self._in_step, records, problems, self._runs.columns)
        lower, upper, widths = (np.array([getattr(p, n) for p in problems]) for n in ("lower", "upper", "prior_std"))
        z = np.zeros_like(lower)
        going, alone, converged = (np.full(len(z), value) for value in (True, False, False))
        noise = np.array([self._runs.first_noise(y) for y in least.measured])
        evaluations = np.zeros(len(z), dtype=np.int64)
        freedom = np.sqrt(least.samples / np.maximum(least.samples - z.shape[1], 1))
        for _ in range(WEIGHT_PASSES):
            squares = partial(least.squares, noise)
            solved = solve_in_step(squares, z, lower, upper, going, MOST_EVALUATIONS)
            evaluations += solved.evaluations
            alone |= solved.given_up
            going &= ~solved.given_up
            z = np.where(going[:, None], solved.unknowns, z)
            converged = np.where(going, solved.converged, converged)
            used, left = noise, freedom[:, None] * np.maximum(least.rms(z, going), self._runs.least_noise)
            noise = np.where(going[:, None], left, noise)
            going &= converged & ~np.isclose(noise, used, rtol=NOISE_CONVERGED, atol=0).all(axis=1)
            if not going.any():
                break
        least.tell(z, ~alone)
        prior = np.sum((z / widths) ** 2, axis=1)
        criterion = 2 * (least.present.sum(axis=1) * np.log(noise)).sum(axis=1) + prior
        return [
            None if alone[m] else Search(z[m], noise[m], int(evaluations[m]), bool(converged[m]), float(criterion[m]))
            for m in range(len(z))
        ]


class _Least:
    """Sums of squares of the records, whose last runs are kept: a search starts where the one before ended."""

    def __init__(
        self, runs: FreeRunsInStep, records: Sequence[Dataset], problems: Sequence[Problem], columns: Sequence[int]
    ) -> None:
        self._runs, self._problems = runs, problems
        self._batch = Batch.of(records, problems)
        self.measured = np.array([r.outputs[:, columns] for r in records])
        self.present = np.isfinite(self.measured)
        self.samples = self.present.sum(axis=(1, 2))
        self._precision = 1 / np.array([p.prior_std for p in problems])
        self._at = np.full((len(records), len(problems[0].centre)), np.nan)
        self._kept: RunsInStep | None = None

    def squares(self, noise: FloatArray, z: FloatArray, wanted: Mask) -> Squares:
        """Sums at unknowns (M, d) with noise levels (M, m), for the records wanted."""
        runs, weight = self._run(z, wanted), self.present / noise[:, None, :]
        errors = np.where(self.present, self.measured - runs.outputs, 0.0) * weight
        rows = np.concatenate([-runs.gradient * weight[..., None], errors[..., None]], axis=3)
        rows = rows.reshape(len(z), -1, rows.shape[3])
        sums = np.matmul(rows.transpose(0, 2, 1), rows)
        precision, d = self._precision**2, z.shape[1]
        cost = 0.5 * (sums[:, d, d] + np.sum(precision * z**2, axis=1))
        normal = sums[:, :d, :d].copy()
        np.einsum("mii->mi", normal)[...] += precision
        finite = runs.good & np.isfinite(sums).all(axis=(1, 2))
        return Squares(np.where(finite, cost, np.nan), sums[:, :d, d] + precision * z, normal)

    def rms(self, z: FloatArray, wanted: Mask) -> FloatArray:
        """Root mean square of the errors (M, m) of the records wanted."""
        runs = self._run(z, wanted)
        errors = np.where(self.present, self.measured - runs.outputs, 0.0)
        total = np.ascontiguousarray(errors.transpose(0, 2, 1) ** 2).sum(axis=2)
        rms: FloatArray = np.sqrt(total / self.present.sum(axis=1))
        return rms

    def tell(self, z: FloatArray, wanted: Mask) -> None:
        """Let the problems know the runs from these unknowns."""
        runs = self._run(z, wanted)
        for m in np.flatnonzero(wanted).tolist():
            problem = self._problems[m]
            problem.remember("start", z[m], (runs.parameters[m], runs.start[m]))
            problem.remember("outputs", z[m], runs.outputs[m])
            problem.remember("gradients", z[m], (runs.gradient[m], runs.last_gradient[m]))
            problem.remember("last state", z[m], runs.last_state[m])

    def _run(self, z: FloatArray, wanted: Mask) -> RunsInStep:
        """Runs of all records; of those wanted they are from z."""
        new = np.flatnonzero(wanted & (z != self._at).any(axis=1)) if self._kept else np.arange(len(z))
        if new.size:
            runs = self._runs(self._batch.part(new), z[new])
            self._kept = runs if self._kept is None else self._kept.replaced(new, runs)
            self._at[new] = z[new]
        assert self._kept is not None
        return self._kept
