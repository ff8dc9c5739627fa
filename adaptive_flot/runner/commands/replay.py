"""Replay a record through one estimator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.contracts import AnyEstimator, ControllerSetup, Prior, Setup, full_parameters
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.contracts.track import Track
from adaptive_flot.described import Described
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.plugins import BATCH_ESTIMATORS, CONTROLLERS, ESTIMATORS, load
from adaptive_flot.runner.commands.record_blocks import Blocks
from adaptive_flot.runner.loop.loop import run_loop
from adaptive_flot.runner.plants.plant import ReplayPlant
from adaptive_flot.runner.results.replay_table import ReplayErrors, replay_errors, replay_table
from adaptive_flot.runner.scenario.keys import Plugin


@dataclass(frozen=True, repr=False)
class Replay(Described):
    """One estimator over the record.

    Attributes
    ----------
    estimator
        Its name.
    parameters
        Label to (value, standard deviation) at the end of the fit block.
    errors
        For each block and measured output.
    table
        Time series: block, time, inputs, and for each output `_measured`, `_predicted`, `_innovation`, `_free_run`; for
        each parameter `_estimate`, `_std`; `status`.
    status_counts
        How often which status was returned.
    """

    estimator: str
    parameters: dict[str, tuple[float, float]]
    errors: tuple[ReplayErrors, ...]
    table: pd.DataFrame
    status_counts: dict[str, int]

    def described(self) -> dict[str, object]:
        """Who, and the parameters at the end of the fit block; see `Described`."""
        return {"estimator": self.estimator, **{k: f"{v:.4g} ± {s:.2g}" for k, (v, s) in self.parameters.items()}}


def replay(name: str, plugin: Plugin, setup: Setup, blocks: Blocks, batch: BatchFit, folder: Path | None) -> Replay:
    """Replay both blocks of a record through one estimator; parameters come from the fit block only.

    Parameters
    ----------
    name
        Name to show.
    plugin
        The estimator, or the batch fit held fixed.
    setup
        What it is built for.
    blocks
        The record.
    batch
        Batch fit of the fit block.
    folder
        Folder of a user's own estimator file.

    Raises
    ------
    PluginError
        The estimator can not be loaded.
    """
    held = plugin.use in BATCH_ESTIMATORS
    estimator = (Plugin(use="fixed") if held else plugin).make(setup, ESTIMATORS, "estimator", folder)
    prior = _start(plugin.use, setup, blocks, batch)

    first = _track(blocks.fit, estimator, setup, prior)
    end = first.end(prior.noise_std)
    x_test = end.state if blocks.continues else batch.initial_state
    second = _track(blocks.test, estimator, setup, replace(end, time=float(blocks.test.time[0]), state=x_test))

    simulator = RecordSimulator(setup.model, setup.dt)
    p = full_parameters(setup.model, setup.parameters, end.parameters)
    free_fit = simulator.outputs(blocks.fit, batch.initial_state, p)
    x_free = simulator.last_state(blocks.fit, batch.initial_state, p) if blocks.continues else batch.initial_state
    free_test = simulator.outputs(blocks.test, x_free, p)

    known = batch.covariance if held else None  # held parameters keep what the fit knew of them
    tables = [
        replay_table("fit", setup, blocks.fit, first, free_fit, known),
        replay_table("test", setup, blocks.test, second, free_test, known).iloc[1 if blocks.continues else 0 :],
    ]
    labels = [setup.model.parameters[i].label for i in setup.model.indices("parameters", setup.parameters)]
    std = np.sqrt(np.diag(end.covariance if known is None else known))
    return Replay(
        estimator=name,
        parameters={k: (float(v), float(s)) for k, v, s in zip(labels, end.parameters, std, strict=True)},
        errors=tuple(e for t in tables for e in replay_errors(setup, t)),
        table=pd.concat(tables, ignore_index=True),
        status_counts=dict(Counter(status.name.lower() for status in (*first.statuses, *second.statuses))),
    )


def _start(use: str, setup: Setup, blocks: Blocks, batch: BatchFit) -> Prior:
    """`fixed` holds the nominal parameters; the others start from the batch fit, as the paper's RPEM does."""
    values = batch.values()
    if use == "fixed":
        values = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    return Prior(float(blocks.fit.time[0]), batch.initial_state, values, batch.covariance, batch.noise_std)


def _track(record: Dataset, estimator: AnyEstimator, setup: Setup, prior: Prior) -> Track:
    """Replay rows 1, 2, ... of a record: at once where the estimator can, else by the runner's loop."""
    whole: Callable[..., Track] | None = getattr(estimator, "track", None)
    if whole is not None:
        return whole(estimator.init(prior), record.time[1:], record.inputs[1:], record.outputs[1:])
    controller = load("schedule", CONTROLLERS, "controller")(ControllerSetup(setup.model, setup.dt, record.inputs[1:]))
    plant = ReplayPlant(record, len(setup.model.parameters))
    steps = run_loop(plant, estimator, controller, len(record) - 1, initial_intervals=0, make_prior=lambda _: prior)
    return Track.of([s.estimate for s in steps if s.estimate is not None])
