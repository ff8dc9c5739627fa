"""Make record k of a seed: draw, size, add faults, measure what there is to gain; the table and its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.hidden_effects.cell.simulate import Array, SimulationError
from benchmarks.hidden_effects.cell.sites import INPUTS
from benchmarks.hidden_effects.generate import nominal_fit, schedule
from benchmarks.hidden_effects.generate.categories import DrawError, DrawnRecord, draw_record
from benchmarks.hidden_effects.generate.ground_truth import GroundTruth
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, run, wander_spec

ATTEMPTS = 8
FIT_SHARE, REPORT_SHARE = 0.6, 0.8  # of the record: fitted before the first, reported on after the second
BIN = 10  # rows; row k is the time k + 1 s


@dataclass(frozen=True)
class Record:
    """One record of the benchmark."""

    name: str
    table: pd.DataFrame
    answer: GroundTruth


def make_record(seed: int, k: int) -> Record:
    """Record k of a seed, always the same.

    Raises
    ------
    RuntimeError
        No attempt gave a cell that runs (a fault of the generator, not of the user).
    """
    problems = []
    for attempt in range(ATTEMPTS):
        rng = schedule.child(seed, k, attempt)
        try:
            case = draw_record(seed, k, rng, last=attempt == ATTEMPTS - 1)
            wander = wander_spec(case.experiment, rng)
            calm = case.done or run(case.experiment, case.specs, case.structure)
            done = run(case.experiment, [*case.specs, wander], case.structure) if wander else calm
            return _finish(seed, k, case, done, calm)
        except (SimulationError, DrawError) as error:
            problems.append(str(error))
    raise RuntimeError(f"record {k} of seed {seed}: {'; '.join(problems)}")


def _finish(seed: int, k: int, case: DrawnRecord, done: SimulatedRun, calm: SimulatedRun) -> Record:
    """Table and answer; `calm` is the run without the wander of the feed, which no oracle knows."""
    experiment, name = case.experiment, f"record_{k:04d}"
    measured = {column: done.noisy[column] for column in experiment.outputs}
    for fault in case.faults:
        if fault.output in measured:
            measured[fault.output] = fault.apply(measured[fault.output])
    predicted, fitted = _base(experiment, done, measured)
    known = calm.clean if experiment.loop == "open" else done.clean
    base, oracle = _errors(measured, predicted), _errors(measured, known)
    answer = GroundTruth(
        record=name, category=case.category, verdict=case.verdict, right_verdicts=list(case.right_verdicts),
        effects=list(case.hidden), tolerated=list(case.tolerated), ordinary=case.ordinary, loop=experiment.loop,
        noise={"kind": experiment.noise.kind, **(experiment.noise.details or {}),
               "feed_wander": experiment.noise.feed_wander, "std": _std(done, measured)},
        seed=[seed, k], rows=experiment.rows, n=experiment.n, C=experiment.C, start=done.start,
        drift=list(case.drift), note=case.note, size=case.size, absorbed=fitted, base_error=base, oracle_error=oracle,
        squares=_squares(measured, predicted, known),
    )  # fmt: skip
    columns: dict[str, Any] = {"time_s": np.arange(1.0, experiment.rows + 1.0)}
    columns |= dict(zip(INPUTS, done.inputs.T, strict=True)) | measured
    return Record(name, pd.DataFrame(columns), answer)


def _std(done: SimulatedRun, measured: dict[str, Array]) -> dict[str, float]:
    return {name: float(np.std(done.noisy[name] - done.clean[name])) for name in measured}


def _errors(measured: dict[str, Array], predicted: dict[str, Array]) -> dict[str, dict[str, float]]:
    """Root mean square of measured - predicted on the part fitted and the part reported on; missing left out."""
    count = len(next(iter(measured.values())))
    fit, report = slice(nominal_fit.BURN_IN, int(FIT_SHARE * count)), slice(int(REPORT_SHARE * count), None)
    errors = {}
    for name, y in measured.items():
        error = y - predicted[name]
        parts = {"fit": error[fit], "report": error[report]}
        errors[name] = {
            part: float(np.sqrt(np.mean(e[np.isfinite(e)] ** 2))) if np.isfinite(e).any() else float("nan")
            for part, e in parts.items()
        }
    return errors


def _squares(
    measured: dict[str, Array], base: dict[str, Array], oracle: dict[str, Array]
) -> dict[str, dict[str, list[float]]]:
    """Sums of squared errors of base and oracle and rows that were measured, in bins of BIN rows.

    So the error on any part of the record can be told, whatever a command kept for its report.
    """
    squares = {}
    for name, y in measured.items():
        bins = len(y) // BIN
        present = np.isfinite(y[: bins * BIN]).reshape(bins, BIN)
        sums = {"rows": [float(n) for n in present.sum(axis=1)]}
        for key, columns in (("base", base), ("oracle", oracle)):
            error = (y - columns[name])[: bins * BIN].reshape(bins, BIN)
            sums[key] = [float(f"{e:.6g}") for e in np.sum(np.where(present, error, 0.0) ** 2, axis=1)]
        squares[name] = sums
    return squares


def _base(
    experiment: Experiment, done: SimulatedRun, measured: dict[str, Array]
) -> tuple[dict[str, Array], dict[str, float]]:
    """What the nominal cell fitted to the first 60 % predicts, and how far n and C went to get there."""
    noise = {name: max(s, 1e-12) for name, s in _std(done, measured).items()}
    rows = slice(nominal_fit.BURN_IN, int(FIT_SHARE * experiment.rows))
    guess = (experiment.n, experiment.C)
    fit = nominal_fit.fit_nominal(done.inputs, measured, noise, done.start, rows, guess)
    moved = {"n": fit.n / experiment.n - 1.0, "C": fit.C / experiment.C - 1.0}
    return fit.predicted, moved
