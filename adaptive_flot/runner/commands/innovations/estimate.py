"""A record in innovations form: process noise, errors k steps ahead, states and parameters smoothed with bands.

The parameters come from the fit block by maximum likelihood with process noise on every state. They may walk, where
the fit block is likelier so by more than it costs, and is predicted no worse. Kristensen, Madsen & Jorgensen,
*Automatica* 40 (2004) 225.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.batch import BatchFit, ParameterEstimate
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.filter.thinning import is_short
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering import NoiseModel
from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.commands.innovations.form import HORIZONS, HorizonError, best_form
from adaptive_flot.runner.commands.record_blocks import Blocks

ASKED = 3.0
"""A batch fit that leaves so many times the noise from row to row asks for process noise."""


@dataclass(frozen=True)
class InnovationsEstimate:
    """A model in innovations form.

    Attributes
    ----------
    estimates
        Parameters, from the fit block.
    noise
        Process noise, measurement noise, and walks of parameters where there are any.
    errors
        Errors on the test block by output and horizon.
    table
        A row an instant: `time_s`, `block`; smoothed states `<state>` and `<state>_std`; parameters `<label>_smoothed`
        and `<label>_smoothed_std`; outputs predicted one row ahead `<column>_predicted` and `<column>_predicted_std`.
    """

    estimates: tuple[ParameterEstimate, ...]
    noise: NoiseModel
    errors: tuple[HorizonError, ...]
    table: pd.DataFrame


def asks_for_process_noise(model: Model, fit: Dataset, outputs: Sequence[str], batch: BatchFit) -> bool:
    """Whether the batch fit leaves far more than noise from row to row, and the record is short enough to be quick."""
    floor = noise_floor([fit], model.indices("outputs", outputs))
    return bool((batch.noise_std > ASKED * floor).any()) and is_short(fit, model)


def estimate_in_innovations_form(setup: Setup, blocks: Blocks, batch: BatchFit) -> InnovationsEstimate:
    """Fit the fit block from where the batch fit ended, then filter and smooth both blocks.

    Parameters
    ----------
    setup
        Model, q parameters and m outputs.
    blocks
        The record in two blocks.
    batch
        Fit of the free run.

    Returns
    -------
    InnovationsEstimate
        Estimates, noise, errors by horizon, and the smoothed course of the record.
    """
    model, columns = setup.model, tuple(setup.model.indices("outputs", setup.outputs))
    fit = replace(blocks.fit, initial_state=batch.initial_state)
    floor = noise_floor([fit], columns)
    with np.errstate(all="ignore"):
        form, refitter = best_form(model, fit, columns, floor, setup.parameters, batch.parameters)
        noise = form.best_noise(fit, refitter)
        if blocks.continues:  # the test block starts at the last row of the fit block
            parts = [(_joined(fit, blocks.test), len(fit) - 1)]
        else:
            parts = [(fit, len(fit)), (replace(blocks.test, initial_state=batch.initial_state), 0)]
        ran = [(record, first, form.run(record, noise)) for record, first in parts]
        tables = [form.table(record, first, filtered) for record, first, filtered in ran]
        record, first, filtered = ran[-1]
        errors = tuple(e for rows in HORIZONS for e in form.errors(record, first, filtered, noise, rows))
    return InnovationsEstimate(form.estimates(), noise, errors, pd.concat(tables, ignore_index=True))


def _joined(fit: Dataset, test: Dataset) -> Dataset:
    """Both blocks as one record, the row they share once."""
    return replace(
        fit,
        time=np.concatenate([fit.time, test.time[1:]]),
        inputs=np.concatenate([fit.inputs, test.inputs[1:]]),
        outputs=np.concatenate([fit.outputs, test.outputs[1:]]),
    )
