"""Delayed measurements for any estimator.

A delayed value is put into the sample at whose time it was taken; the samples since then are taken again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from adaptive_flot.contracts import AnyEstimator, DelayedValue, Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError


@dataclass(frozen=True)
class DelayedState:
    """The estimator's own state now, and the state before each of the last samples with that sample, oldest first."""

    inner: Any
    history: tuple[tuple[Any, Sample], ...]


class DelayedMeasurements:
    """An estimator that also takes delayed values, built around one that does not.

    After a delayed value the estimate is the one that the same value in time would have given, to the bit. The state
    from before its sample is kept. The value is put into that sample, and the samples since then are taken again.
    That costs one update for each sample of the delay. Any other sample costs the estimator's own update and one entry
    of the history, which never grows beyond the window.

    A value belongs to the sample nearest to its time. Where that sample already has a value of this output,
    the delayed one replaces it. A value without a sample is refused, and the status says so: it is older than the
    window, from before the start, or in the future.

    Parameters
    ----------
    estimator
        The estimator.
    window_s
        Largest age of a value that is still used [s].
    """

    def __init__(self, estimator: AnyEstimator, window_s: float) -> None:
        self.setup: Setup = estimator.setup
        self.estimator = estimator
        self.rows = max(1, math.ceil(window_s / self.setup.dt - 1e-9))

    def init(self, prior: Prior) -> DelayedState:
        """Start the estimator; there is no history yet."""
        return DelayedState(self.estimator.init(prior), ())

    def update(self, state: DelayedState, sample: Sample) -> tuple[DelayedState, Estimate]:
        """Use the delayed values, then take the sample; see `Estimator.update`."""
        used: tuple[DelayedValue, ...] = ()
        refused = False
        if sample.delayed:
            state, sample, used, refused = self._take_again(state, sample)
        inner, estimate = self.estimator.update(state.inner, sample)
        if used or refused:
            estimate = replace(estimate, delayed=used, status=_status(estimate.status, refused))
        history = (*state.history, (state.inner, sample))[-self.rows :]
        return DelayedState(inner, history), estimate

    def _take_again(
        self, state: DelayedState, sample: Sample
    ) -> tuple[DelayedState, Sample, tuple[DelayedValue, ...], bool]:
        """State just before the sample, the sample, innovations of the delayed values, whether any was refused."""
        samples = [*(s for _, s in state.history), replace(sample, delayed=())]
        placed, at, refused = put_in_place(samples, sample.delayed, self.setup)
        last = len(state.history)
        first = min(at, default=last)
        inner = state.history[first][0] if first < last else state.inner
        history = list(state.history[:first])
        innovations: list[DelayedValue] = []
        for k in range(first, last):
            history.append((inner, placed[k]))
            inner, estimate = self.estimator.update(inner, placed[k])
            for value in at.get(k, ()):
                j = self.setup.model.index("outputs", value.output)
                innovations.append(replace(value, time=placed[k].time, value=float(estimate.innovation[j])))
        return DelayedState(inner, tuple(history)), placed[last], tuple(innovations), refused


def taking_delayed_values(estimator: AnyEstimator, window_s: float) -> AnyEstimator:
    """Return the estimator itself if nothing is delayed (window 0) or it takes delayed values; else wrap it."""
    if window_s <= 0 or getattr(estimator, "takes_delayed_values", False):
        return estimator
    return DelayedMeasurements(estimator, window_s)


def in_time(samples: Sequence[Sample], setup: Setup) -> list[Sample]:
    """Record as it looks once everything has arrived: delayed values in their places, those without one left out.

    Raises
    ------
    ModelError
        A delayed value of an output that the model does not have.
    """
    delayed = [value for sample in samples for value in sample.delayed]
    return put_in_place([replace(s, delayed=()) for s in samples], delayed, setup)[0] if delayed else list(samples)


def put_in_place(
    samples: Sequence[Sample], delayed: Sequence[DelayedValue], setup: Setup
) -> tuple[list[Sample], dict[int, list[DelayedValue]], bool]:
    """Put delayed values into the samples that they were taken at.

    Parameters
    ----------
    samples
        Samples in uniform time, oldest first.
    delayed
        The delayed values; a value that is not a number is a missing one.
    setup
        Names of the outputs, sampling interval.

    Returns
    -------
    samples
        The samples with the values, where they belong.
    at
        The values used, by position of their sample.
    refused
        Whether a value has no sample among these.

    Raises
    ------
    ModelError
        A delayed value of an output that the model does not have.
    """
    placed = list(samples)
    at: dict[int, list[DelayedValue]] = {}
    refused = False
    for value in delayed:
        j = setup.model.index("outputs", value.output)
        if not math.isfinite(value.value):
            continue
        k = _row(samples, value.time, setup.dt)
        if k is None:
            refused = True
            continue
        outputs = placed[k].outputs.copy()
        if outputs.shape != (len(setup.model.outputs),):
            raise ModelError(f"a sample has {outputs.shape} outputs, the model ({len(setup.model.outputs)},)")
        outputs[j] = value.value
        placed[k] = replace(placed[k], outputs=outputs)
        at.setdefault(k, []).append(value)
    return placed, at, refused


def _row(samples: Sequence[Sample], time: float, dt: float) -> int | None:
    if not samples or not math.isfinite(time):
        return None
    k = round((time - samples[0].time) / dt)
    return k if 0 <= k < len(samples) else None


def _status(status: Status, refused: bool) -> Status:
    """What went wrong outranks a refused value, that outranks a used one; those outrank a plain sample."""
    if status in (Status.OK, Status.MISSING):
        return Status.TOO_OLD if refused else Status.DELAYED
    return status
