"""The steps of a model that a record asks for: short enough for it, and no shorter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.greybox.data.dataset import MOST_STEPS, Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.stepper import Stepper

TOLERATED = 0.2
"""Error of the integration, in standard deviations of the noise, that changes nothing of what a record says."""
SMALL = 3e-3
"""Noise, as a share of the spread of an output, that is believed at most: a signal that oscillates within a few rows
differs from row to row by far more than its noise."""
UNSEEN, FEW = 0.02, 4
"""Such an error that longer steps may make, and steps in a row that are not made fewer: they cost little."""
LOOKED_AT = 3000
"""Most rows of a record that are looked at, from its first one on."""
SHORTEST_SHARE = 1 / 64
"""Shortest step that is tried, as a share of the model's own."""


def with_short_steps(
    model: Model,
    record: Dataset,
    state: FloatArray,
    parameters: FloatArray,
    columns: Sequence[int],
    noise: FloatArray,
    *,
    longer: bool = False,
) -> Model:
    """The model, its `max_step_s` halved as often as the record asks for; as it is where its steps are short enough.

    They are where half of them change no output by more than TOLERATED of its noise, or of SMALL of its spread where
    that is less (root of the mean square over the first LOOKED_AT rows). A run that leaves all bounds needs shorter
    ones. A model that no step helps stays as it is.

    Where they may become `longer`, one of more than FEW steps a row takes fewer that change outputs by no more than
    UNSEEN of the noise: a longest step that was left at a second makes every fit to rows of minutes many times as long.

    Parameters
    ----------
    model, record
        The model, and the record that is to be simulated.
    state, parameters
        State (nx,) at the first row, and parameters (np,).
    columns
        Indices of the m measured outputs.
    noise
        Standard deviation of the noise of each (m,).
    longer
        Whether steps that are far too short are made longer.
    """
    part = record.rows(0, min(len(record), LOOKED_AT))
    own = model.steps_in(record.dt)
    measured = part.outputs[:, list(columns)]
    spread = np.nan_to_num(np.nanstd(measured, axis=0))
    noise = np.minimum(noise, np.where(spread > 0, SMALL * spread, np.inf))

    def run(steps: int) -> FloatArray:
        simulator = RecordSimulator(model, part.dt, stepper=Stepper(model, part.dt, substeps=steps))
        with np.errstate(all="ignore"):
            return simulator.outputs(part, state, parameters)[:, list(columns)]

    def taken(steps: int) -> Model:
        share = model.max_step_s / model.longest_step_s
        return replace(model, max_step_s=share * record.dt / steps)

    steps, coarse = own, run(own)
    while steps * SHORTEST_SHARE <= own and 2 * steps * len(record) <= MOST_STEPS:
        fine = run(2 * steps)
        if _agree(coarse, fine, noise):
            fewer = _fewest(run, own, coarse, noise) if longer and steps == own else steps
            return model if fewer == own else taken(fewer)
        steps, coarse = 2 * steps, fine
    return model


def _fewest(run: Callable[[int], FloatArray], own: int, exact: FloatArray, noise: FloatArray) -> int:
    """Fewest steps of those that halve the model's own, again and again, which change next to nothing."""
    steps = own
    while steps >= 2 * FEW and _agree(run(steps // 2), exact, noise * UNSEEN / TOLERATED):
        steps //= 2
    return steps


def _agree(coarse: FloatArray, fine: FloatArray, noise: FloatArray) -> bool:
    """Whether two runs (N, m) are finite and the same but for a small share of the noise (m,)."""
    with np.errstate(all="ignore"):  # a run that leaves all bounds
        apart = np.sqrt(np.mean((coarse - fine) ** 2, axis=0))
    return bool((apart <= TOLERATED * noise).all())  # nan compares as false
