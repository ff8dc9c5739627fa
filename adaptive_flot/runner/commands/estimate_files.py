"""Files that `estimate` writes beside its report."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.processes.flotation import save_cell
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.commands.innovations.estimate import InnovationsEstimate

SMOOTHED = "smoothed.csv"
"""States and parameters given the whole record, where the innovations form was asked for."""


def estimate_summary(data: Path, result: RecordEstimate) -> dict[str, Any]:
    """JSON summary: batch fit with covariance and identifiability, then each estimator with its errors."""
    batch = result.batch
    return {
        "data": data.name,
        "model": result.setup.model.name,
        "fit": {
            "outputs": list(result.setup.outputs),
            "parameters": [asdict(e) for e in batch.estimates],
            "covariance": batch.covariance,
            "noise_std": dict(zip(result.setup.outputs, batch.noise_std.tolist(), strict=True)),
            "initial_state": dict(zip(result.setup.model.names("states"), batch.initial_state.tolist(), strict=True)),
            "identifiability": asdict(batch.identifiability),
            "status": batch.status,
            "searches": {"from_different_starts": batch.starts, "ended_at_this_fit": batch.agreed},
        },
        "estimators": [
            {
                "estimator": replay.estimator,
                "parameters": {k: {"value": v, "std": s} for k, (v, s) in replay.parameters.items()},
                "errors": [asdict(e) for e in replay.errors],
                "status_counts": replay.status_counts,
            }
            for replay in result.replays
        ],
        "innovations_form": None if result.innovations is None else _innovations_summary(result.innovations),
    }


def _innovations_summary(form: InnovationsEstimate) -> dict[str, Any]:
    return {
        "parameters": [asdict(e) for e in form.estimates],
        "process_noise_per_sqrt_s": dict(form.noise.process),
        "measurement_noise": dict(form.noise.measurement),
        "walk_per_sqrt_s": dict(form.noise.walk),
        "errors": [asdict(e) for e in form.errors],
    }


def write_replays(result: RecordEstimate, folder: Path) -> None:
    """Write the time series of each estimator as `<estimator>.csv`, and what was smoothed."""
    for replay in result.replays:
        write_table(replay.table, folder / replay_file(replay.estimator))
    if result.innovations is not None:
        write_table(result.innovations.table, folder / SMOOTHED)


def replay_file(estimator: str) -> str:
    """Name of the file of an estimator's time series.

    >>> replay_file("my_file:Mine")
    'my_file-Mine.csv'
    """
    return f"{estimator.replace(':', '-').replace('/', '-')}.csv"


def save_fitted_cell(result: RecordEstimate, cell: Path, path: Path) -> None:
    """Write the batch fit as a copy of a cell file; `run`, `simulate` and `estimate` accept it."""
    values = {e.name: e.value for e in result.batch.estimates}
    save_cell(cell, values, f"calibrated on {result.blocks.name}", path)


def save_fitted_model(result: RecordEstimate, path: Path, *, base: str, cell: str | None, folder: Path) -> None:
    """Write the batch fit as a model file; every command that takes a model accepts it."""
    model = result.setup.model.with_parameters({e.name: e.value for e in result.batch.estimates})
    note = f"calibrated on {result.blocks.name}"
    save_model(model, path, base=base, cell=cell, folder=folder, note=note)
