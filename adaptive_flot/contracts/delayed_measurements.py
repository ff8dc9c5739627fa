"""Late measurements for any estimator: a late value is put where it belongs, and the samples since are taken again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from adaptive_flot.contracts import AnyEstimator, Estimate, LateValue, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError


@dataclass(frozen=True)
class LateState:
    """The estimator's own state now, and the state before each of the last samples with that sample, oldest first."""

    inner: Any
    history: tuple[tuple[Any, Sample], ...]


class LateValues:
    """An estimator that also takes late values, built around one that does not.

    After a late value the estimate is the one that the same value would have given in time, to the bit: the state from
    before its sample is kept, the value is put into that sample, and the samples since then are taken again. That
    costs as many updates as the value is late; any other sample costs the estimator's own update and one entry of
    the history, which never grows beyond the window.

    A value belongs to the sample nearest to its time. Where that sample already has a value of this output, the late
    one replaces it. A value without a sample (older than the window, from before the start, in the future) is
    refused, and the status says so.

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

    def init(self, prior: Prior) -> LateState:
        """Start the estimator; there is no history yet."""
        return LateState(self.estimator.init(prior), ())

    def update(self, state: LateState, sample: Sample) -> tuple[LateState, Estimate]:
        """Use the late values, then take the sample; see `Estimator.update`."""
        used: tuple[LateValue, ...] = ()
        refused = False
        if sample.late:
            state, sample, used, refused = self._take_again(state, sample)
        inner, estimate = self.estimator.update(state.inner, sample)
        if used or refused:
            estimate = replace(estimate, late=used, status=_status(estimate.status, refused))
        history = (*state.history, (state.inner, sample))[-self.rows :]
        return LateState(inner, history), estimate

    def _take_again(self, state: LateState, sample: Sample) -> tuple[LateState, Sample, tuple[LateValue, ...], bool]:
        """State just before the sample with its late values in their places, the sample, innovations, any refused."""
        samples = [*(s for _, s in state.history), replace(sample, late=())]
        placed, at, refused = put_in_place(samples, sample.late, self.setup)
        last = len(state.history)
        first = min(at, default=last)
        inner = state.history[first][0] if first < last else state.inner
        history = list(state.history[:first])
        innovations: list[LateValue] = []
        for k in range(first, last):
            history.append((inner, placed[k]))
            inner, estimate = self.estimator.update(inner, placed[k])
            for value in at.get(k, ()):
                j = self.setup.model.index("outputs", value.output)
                innovations.append(replace(value, time=placed[k].time, value=float(estimate.innovation[j])))
        return LateState(inner, tuple(history)), placed[last], tuple(innovations), refused


def taking_late_values(estimator: AnyEstimator, window_s: float) -> AnyEstimator:
    """Return the estimator itself where nothing is late (a window of 0) or it takes late values; else wrapped."""
    if window_s <= 0 or getattr(estimator, "takes_late_values", False):
        return estimator
    return LateValues(estimator, window_s)


def in_time(samples: Sequence[Sample], setup: Setup) -> list[Sample]:
    """Record as it looks once everything has arrived: late values in their places; those without a place are left out.

    Raises
    ------
    ModelError
        A late value of an output that the model does not have.
    """
    late = [value for sample in samples for value in sample.late]
    return put_in_place([replace(s, late=()) for s in samples], late, setup)[0] if late else list(samples)


def put_in_place(
    samples: Sequence[Sample], late: Sequence[LateValue], setup: Setup
) -> tuple[list[Sample], dict[int, list[LateValue]], bool]:
    """Put late values into the samples that they were taken at.

    Parameters
    ----------
    samples
        Samples in uniform time, oldest first.
    late
        The late values; a value that is not a number is a missing one.
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
        A late value of an output that the model does not have.
    """
    placed = list(samples)
    at: dict[int, list[LateValue]] = {}
    refused = False
    for value in late:
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
        return Status.TOO_OLD if refused else Status.LATE
    return status
