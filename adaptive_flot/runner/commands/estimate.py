"""Estimate on a measured record: a batch fit, then a replay through each estimator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.described import Described
from adaptive_flot.errors import DataError, ModelError, PluginError, located, near_match
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.assumed_start import wrong_start
from adaptive_flot.greybox.steady.likely_unit import off_by_a_unit
from adaptive_flot.greybox.stepping.step_functions import check_interval
from adaptive_flot.plugins import BATCH_ESTIMATORS, ESTIMATORS, OF_A_RECORD, construct, load
from adaptive_flot.runner.commands.innovations.estimate import (
    InnovationsEstimate,
    asks_for_process_noise,
    estimate_in_innovations_form,
)
from adaptive_flot.runner.commands.record_blocks import Blocks
from adaptive_flot.runner.commands.replay import Replay, replay
from adaptive_flot.runner.scenario.keys import Plugin

BATCH_OPTIONS: Mapping[str, Any] = {"initial_state": "estimated", "starts": 12}
"""Options of the batch fit: the first state is not known, and a fit that leaves much is tried from further starts."""


@dataclass(frozen=True, repr=False)
class RecordEstimate(Described):
    """Result of `estimate`: the blocks, the batch fit of the fit block and the replays."""

    blocks: Blocks
    setup: Setup
    batch: BatchFit
    replays: tuple[Replay, ...]
    innovations: InnovationsEstimate | None = None
    """The record in innovations form, where it was asked for."""

    def described(self) -> dict[str, object]:
        """Record, batch fit and estimators; see `Described`."""
        fitted = {e.label: f"{e.value:.4g} ± {e.std:.2g} {e.unit}" for e in self.batch.estimates}
        return {"record": self.blocks.name, **fitted, "estimators": ", ".join(r.estimator for r in self.replays)}


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # a run that leaves all bounds is a status
def estimate_record(
    blocks: Blocks,
    model: Model,
    *,
    estimators: Sequence[str] | Mapping[str, Plugin] = OF_A_RECORD,
    fit: Sequence[str] = (),
    outputs: Sequence[str] = (),
    folder: Path | None = None,
    innovations: bool | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> RecordEstimate:
    """Fit the fit block, then replay both blocks through each estimator.

    Parameters
    ----------
    blocks
        The record, from `read_blocks`.
    model
        The model; its parameter values are the nominal ones.
    estimators
        Shipped names, `pem` for the batch fit held fixed, or `my_file:MyEstimator`; or plug-ins by the name to show;
        default `OF_A_RECORD`.
        All start at the fitted initial state: `fixed` with the nominal parameters, the others with the batch fit of
        the fit block.
    fit
        Parameters to estimate; default those with the role "estimated".
    outputs
        Outputs that drive the estimation; default all that are measured.
    folder
        Folder of a user's own estimator file.
    innovations
        Whether to estimate in innovations form as well, with process noise; None where the record asks for it.
    progress
        Called with a word before the batch fit, before each estimator, and before the fit with process noise.

    Raises
    ------
    DataError, ModelError, PluginError
        Nothing measured, unknown names, an estimator that can not be loaded, or one that needs the truth. A sampling
        interval of too many steps.
    """
    names = model.expand_parameters(fit) if fit else tuple(p.name for p in model.parameters if p.role == "estimated")
    if not names:
        raise ModelError(
            f"model '{model.name}' has no parameter with role=\"estimated\", so nothing is fitted; "
            "name some with --fit, or give them that role in the model"
        )
    plugins = dict(estimators) if isinstance(estimators, Mapping) else {n: shipped_plugin(n) for n in estimators}
    for name, plugin in plugins.items():
        if plugin.use not in BATCH_ESTIMATORS and plugin.needs_truth(folder):
            raise PluginError(f"estimator {name!r} is shown the true parameters, which no record holds; leave it out")
    driving = tuple(outputs) or blocks.fit.measured(model)
    model.indices("outputs", driving)
    unmeasured = [o for o in driving if o not in blocks.fit.measured(model)]
    if unmeasured or not driving:
        raise DataError(f"{blocks.name}: output {(unmeasured or ['any'])[0]!r} is not measured in the record; add it")
    with located(blocks.name):
        check_interval(model, blocks.fit.dt)
    setup = Setup(model, blocks.fit.dt, names, driving)
    progress("batch fit")
    factory = load("pem", BATCH_ESTIMATORS, "batch estimator")
    batch: BatchFit = construct(factory, "pem", "batch estimator", setup, **BATCH_OPTIONS).fit(blocks.fit)
    columns, noise = model.indices("outputs", driving), batch.noise_std
    said = off_by_a_unit(model, blocks.fit.inputs, blocks.fit.outputs)
    said += wrong_start(model, blocks.fit, batch.initial_state, batch.parameters, columns, noise)
    blocks = replace(blocks, fit=replace(blocks.fit, notes=blocks.fit.notes + said))
    replays = []
    for name, plugin in plugins.items():
        progress(f"replay through {name}")
        replays.append(replay(name, plugin, setup, blocks, batch, folder))
    if innovations is None:
        innovations = asks_for_process_noise(model, blocks.fit, driving, batch)
    form = None
    if innovations and batch.evaluations:
        progress("fit with process noise")
        form = estimate_in_innovations_form(setup, blocks, batch)
    return RecordEstimate(blocks, setup, batch, tuple(replays), form)


def shipped_plugin(name: str) -> Plugin:
    """Plug-in behind a shipped name, `pem`, or `my_file:MyEstimator`.

    Raises
    ------
    PluginError
        None of these; the message holds the nearest name.
    """
    known = {**ESTIMATORS, **BATCH_ESTIMATORS}
    if name not in known and ":" not in name:
        raise PluginError(f"unknown estimator {name!r}; {near_match(name, known)}")
    return Plugin(use=name)
