"""The table of a replay, and its errors by output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot import metrics
from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.results.whiteness import ljung_box_p


@dataclass(frozen=True)
class ReplayErrors:
    """Errors of one output in one block.

    Attributes
    ----------
    block, output, unit
        Which.
    one_step, free_run
        Root mean square error [unit]: of the estimator's predictions one sample ahead, and of a simulation with the
        parameters it had at the end of the fit block held.
    ljung_box_p
        p value of the Ljung-Box test of the innovations over 20 lags; small: not white, something is left.
    samples
        Number of measurements.
    """

    block: str
    output: str
    unit: str
    one_step: float
    free_run: float
    ljung_box_p: float
    samples: int


EXPLODED = 1e100
"""An output beyond this, in its unit, is of a run that has left the model."""


def replay_table(
    block: str, setup: Setup, record: Dataset, track: Track, free: FloatArray, known: FloatArray | None
) -> pd.DataFrame:
    """Table of one block of a replay; see `Replay.table`.

    Parameters
    ----------
    block
        "fit" or "test".
    setup
        What the estimator was built for.
    record
        The rows of the block (N).
    track
        Estimates at rows 1, 2, ... (N - 1).
    free
        Outputs of the free run (N, ny). Where a run has exploded, the table has NaN.
    known
        Covariance (q, q) of parameters that are held; None: the estimator's own.
    """
    model = setup.model
    free, follows = (np.where(np.abs(y) < EXPLODED, y, np.nan) for y in (free, track.prediction))
    predicted = np.vstack([free[0], follows])  # row 0 is the initial instant
    columns: dict[str, object] = {"block": [block] * len(record), "time_s": record.time}
    columns |= {q.column: record.inputs[:, j] for j, q in enumerate(model.inputs)}
    for j, q in enumerate(model.outputs):
        if np.isfinite(record.outputs[:, j]).any():
            columns[f"{q.column}_measured"] = record.outputs[:, j]
            columns[f"{q.column}_predicted"] = predicted[:, j]
            columns[f"{q.column}_innovation"] = record.outputs[:, j] - predicted[:, j]
            columns[f"{q.column}_free_run"] = free[:, j]
    theta = np.vstack([track.parameters[:1], track.parameters])
    covariance = np.concatenate([track.covariance[:1], track.covariance])
    variances = np.diagonal(covariance if known is None else np.tile(known, (len(theta), 1, 1)), axis1=1, axis2=2)
    std = np.sqrt(variances)
    for j, i in enumerate(model.indices("parameters", setup.parameters)):
        columns[f"{model.parameters[i].label}_estimate"] = theta[:, j]
        columns[f"{model.parameters[i].label}_std"] = std[:, j]
    columns["status"] = [s.name.lower() for s in (track.statuses[0], *track.statuses)]
    return pd.DataFrame(columns)


def replay_errors(setup: Setup, table: pd.DataFrame) -> list[ReplayErrors]:
    """Errors of each measured output in the table of one block."""
    errors = []
    for q in setup.model.outputs:
        if f"{q.column}_measured" not in table:
            continue
        innovation = table[f"{q.column}_innovation"].to_numpy(dtype=float)
        free = (table[f"{q.column}_measured"] - table[f"{q.column}_free_run"]).to_numpy(dtype=float)
        errors.append(
            ReplayErrors(
                block=str(table["block"].iloc[0]),
                output=q.name,
                unit=q.unit,
                one_step=metrics.rmse(innovation),
                free_run=metrics.rmse(free),
                ljung_box_p=ljung_box_p(innovation),
                samples=int(np.isfinite(innovation).sum()),
            )
        )
    return errors
