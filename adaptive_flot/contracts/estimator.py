"""The contract of an estimator: what it is built for, where it starts, what it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

from adaptive_flot.contracts.sample import DelayedValue, Sample
from adaptive_flot.contracts.status import Status
from adaptive_flot.described import Described
from adaptive_flot.greybox.model import FloatArray, Model

State = TypeVar("State")


@dataclass(frozen=True, repr=False)
class Setup(Described):
    """What an estimator is built for.

    Attributes
    ----------
    model
        The grey-box model; its parameter values are the nominal ones.
    dt
        Sampling interval [s].
    parameters
        Names of the q adapted parameters.
    outputs
        Names of the measured outputs that drive the adaptation.
    truth
        True parameters (N, np), row k for the interval that starts at k dt; None for all estimators but those
        whose class says `needs_truth = True` (the oracle).
    unmeasured
        Names of parameters of the model that are disturbances of the plant which nobody measures.
    """

    model: Model
    dt: float
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    truth: FloatArray | None = None
    unmeasured: tuple[str, ...] = ()

    def described(self) -> Mapping[str, object]:
        """For what it is; see `Described`."""
        return {
            "model": self.model.name,
            "dt": f"{self.dt:g} s",
            "parameters": ", ".join(self.parameters),
            "outputs": ", ".join(self.outputs),
        }


@dataclass(frozen=True)
class Prior:
    """Where an estimator starts.

    Attributes
    ----------
    time
        Time of the state [s].
    state
        Model state (nx,).
    parameters
        Adapted parameters (q,), each in its unit.
    covariance
        Their covariance (q, q).
    noise_std
        Standard deviation of the measurement noise of each driving output (m,).
    joint_covariance
        Covariance of state and parameters together (nx + q, nx + q); None: the state is taken as known.
    colour
        Long-run variance of what a fit leaves of each driving output (m,), over its variance: about 1 for white noise.
        Where it is larger the model does not explain the record, and the covariance is too small. None: not known.
    core_noise_std
        Standard deviation of the noise without its outliers (m,), for an estimator that knows of outliers. None: that
        of all noise.
    ongoing
        Whether this is the estimate of an estimator that ran, and no fit: its covariance allows for the colour already.
    disturbances
        Value and standard deviation of unmeasured disturbances that are known, by parameter name, each in its unit.
    """

    time: float
    state: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    noise_std: FloatArray
    joint_covariance: FloatArray | None = None
    colour: FloatArray | None = None
    core_noise_std: FloatArray | None = None
    ongoing: bool = False
    disturbances: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def at(self, estimate: Estimate) -> Prior:
        """Where an estimator that began here starts again: at its estimate, with what was known of the errors."""
        return replace(
            self,
            time=estimate.time,
            state=estimate.state,
            parameters=estimate.parameters,
            covariance=estimate.covariance,
            joint_covariance=None,
            ongoing=True,
            disturbances={
                name: (v, estimate.disturbance_std.get(name, 0.0)) for name, v in estimate.disturbances.items()
            },
        )

    @property
    def core_noise(self) -> FloatArray:
        """Standard deviation of the noise (m,), without outliers where that is known: what the covariance rests on."""
        return self.noise_std if self.core_noise_std is None else self.core_noise_std


@dataclass(frozen=True)
class Estimate:
    """Info record of one estimator step.

    Attributes
    ----------
    time
        Time of the sample [s].
    prediction
        All outputs (ny,) predicted from the previous sample, before this one was used.
    innovation
        Measured minus predicted (ny,), NaN where missing.
    innovation_std
        Standard deviation the estimator expects of the innovation of each driving output (m,).
    parameters
        Adapted parameters after the sample (q,).
    covariance
        Their covariance (q, q), symmetric and positive semi-definite.
    state
        Model state (nx,) at the time of the sample.
    status
        What happened.
    discrepancy
        How far each output is off from the model (ny,), in its unit, as the estimator sees it: part of `prediction`.
        None where the prediction is the model's alone.
    disturbances
        Values of the unmeasured disturbances that the estimator has found, by parameter name, each in its unit.
    disturbance_std
        Their standard deviations in the same way.
    delayed
        Innovations of the delayed values that were used: output, time taken, measured minus predicted then.
    """

    time: float
    prediction: FloatArray
    innovation: FloatArray
    innovation_std: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    state: FloatArray
    status: Status
    delayed: tuple[DelayedValue, ...] = ()
    discrepancy: FloatArray | None = None
    disturbances: Mapping[str, float] = field(default_factory=dict)
    disturbance_std: Mapping[str, float] = field(default_factory=dict)

    def shown_with(self, sample: Sample, model: Model) -> Sample:
        """The sample for a controller, with the disturbances found among its parameters."""
        if not self.disturbances:
            return sample
        p = model.parameter_values if sample.parameters is None else sample.parameters.copy()
        p[model.indices("parameters", self.disturbances)] = list(self.disturbances.values())
        return replace(sample, parameters=p)


class Estimator(Protocol[State]):
    """Tracks parameters (and the state) from one sample to the next.

    Made by `Name(setup, **options)`. `setup` is kept as an attribute; nothing else may change after construction.

    Delayed measurements: after one, the estimate is what the same value in time would have given. An estimator need
    not see to that: wherever a measurement has a dead time, the loop wraps it (`DelayedMeasurements` in
    `adaptive_flot/contracts/delayed_measurements.py`). An estimator that keeps a window of samples anyway may take
    `Sample.delayed` itself; it then has `takes_delayed_values = True`.

    Whole records: an estimator may have `track(state, time, inputs, outputs) -> Track`
    (`adaptive_flot/contracts/track.py`) that gives for N samples what N calls of `update` give. Replays of measured
    records then use it. One that has `track_ensemble` does the same for many members at once
    (`adaptive_flot/contracts/ensemble_record.py`).
    """

    setup: Setup

    def init(self, prior: Prior) -> State:
        """State before the first sample."""
        ...

    def update(self, state: State, sample: Sample) -> tuple[State, Estimate]:
        """Take one sample, one interval after the last.

        Missing outputs are NaN; a sample in which all driving outputs are missing gives a status, not an error.

        Raises
        ------
        ModelError
            A vector of the wrong length.
        """
        ...


def full_parameters(
    model: Model, names: Sequence[str], values: FloatArray, known: FloatArray | None = None
) -> FloatArray:
    """Parameter vector (np,) with some entries replaced: of `known` (`Sample.parameters`), else of the model."""
    p = model.parameter_values if known is None else known.copy()
    p[model.indices("parameters", names)] = values
    return p


AnyEstimator = Estimator[Any]
