"""What the instruments show at one sampling instant, delayed values included."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True)
class DelayedValue:
    """A measurement known only after its time: output by name, time it was taken [s], value in the output's unit."""

    output: str
    time: float
    value: float


@dataclass(frozen=True)
class Sample:
    """What the instruments show at one sampling instant.

    Outputs may be measured at different rates: at any instant some are NaN, and only the others correct the estimate.

    Attributes
    ----------
    time
        Time [s].
    inputs
        Inputs held during the interval until then (nu,), as far as they are known: commands, and disturbances as they
        are measured or assumed.
    outputs
        Outputs measured at this time (ny,), NaN where there is no measurement.
    delayed
        Values that arrive with this sample and were taken earlier (a laboratory assay, an analyser with dead time).
    parameters
        Parameter vector (np,): the nominal one with what is measured in it (the feed grade); None where nothing is.
    """

    time: float
    inputs: FloatArray
    outputs: FloatArray
    delayed: tuple[DelayedValue, ...] = ()
    parameters: FloatArray | None = None
