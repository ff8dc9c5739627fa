"""Fits of a run, and the share of the time in which its 95 % region holds the parameters that it should."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import chi2

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.metrics import fit, normalised_error_squared
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.kinds_of_change.best_fit import best_fit
from benchmarks.kinds_of_change.truths import Truth
from estimators.shared.coordinates import Coordinates

ESTIMATORS = ("rpem", "rpem_full", "ekf", "imm", "adaptive_imm")
LABELS = ("n", "C")


def held(scenario: Scenario, run: Run, wanted: FloatArray) -> float:
    """Share of the time of the fits in which the region of n and C together holds `wanted` (N, 2).

    In the coordinates of the filters, n and ln C. The standard deviation of ln C is that of C over C. An ellipse of n
    and C itself would reach to negative C, and along a straight line where the two compensate along a curve.
    """
    rows = (run.table["time_s"] > scenario.fits_after + 1e-9).to_numpy()
    table = run.table[rows]
    coordinates = Coordinates.of(scenario.model, scenario.setup.parameters)
    found = table[[f"{x}_estimate" for x in LABELS]].to_numpy()
    slopes = np.where(coordinates.log, found, 1.0)
    std = table[[f"{x}_std" for x in LABELS]].to_numpy() / slopes
    if not (std > 0).all():
        return float("nan")
    values = (np.array([coordinates.from_parameters(row) for row in each]) for each in (found, wanted[rows]))
    error = np.subtract(*values) / std
    between = np.clip(table["n_C_correlation"].to_numpy(), -1 + 1e-9, 1 - 1e-9)
    correlation = np.array([[np.ones_like(between), between], [between, np.ones_like(between)]]).transpose(2, 0, 1)
    return float(np.mean(normalised_error_squared(error, correlation) <= chi2.ppf(0.95, 2)))


def best_fits(scenario: Scenario, run: Run, wanted: FloatArray) -> dict[str, float]:
    """Fits of n and C to `wanted` (N, 2) in percent, over the time of the fits, as `n_best` and `C_best`."""
    rows = (run.table["time_s"] > scenario.fits_after + 1e-9).to_numpy()
    found = run.table.loc[rows, [f"{x}_estimate" for x in LABELS]].to_numpy()
    return {f"{x}_best": fit(wanted[rows, i], found[:, i]) for i, x in enumerate(LABELS)}


def figures(
    truth: Truth, key: str, seeds: Sequence[int], estimators: Sequence[str], folder: Path, *, compiled: bool
) -> pd.DataFrame:
    """A row for each seed and estimator: fits in percent, and the share of the time that is held.

    `n` and `C` are compared with the plant's own, `n_best` and `C_best` with those that the region should hold.
    """
    scenario = truth.scenario(folder, key)
    scenario = scenario.compiled() if compiled else scenario
    wanted = {seed: to_hold(truth, Realisation(scenario, seed)) for seed in seeds}
    return pd.DataFrame(
        [
            {"truth": key, "seed": run.seed, "estimator": run.estimator, **run.fit}
            | best_fits(scenario, run, wanted[run.seed])
            | {"held": held(scenario, run, wanted[run.seed])}
            | {"model_error": run.status_counts.get("model_error", 0) / len(run.table)}
            for run in run_scenario(scenario, estimators, seeds=seeds)
        ]
    )


def to_hold(truth: Truth, realisation: Realisation) -> FloatArray:
    """Parameters (N, q) that the region should hold: the true ones, or the best-fitting ones where none are true."""
    if not truth.has_true_parameters:
        return best_fit(realisation).parameters
    s = realisation.scenario
    return realisation.parameters[:, s.plant_model.indices("parameters", s.setup.parameters)]
