"""The contract of a plant: simulated, replayed from a record, or real."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from adaptive_flot.contracts.sample import Sample
from adaptive_flot.greybox.model import FloatArray

State = TypeVar("State")


@dataclass(frozen=True)
class PlantRecord:
    """What a plant shows after one interval.

    Attributes
    ----------
    sample
        What is measured.
    outputs
        True outputs (ny,), without what effects on sensors add; NaN in a replayed record.
    parameters
        True parameter vector (np,) during the interval, NaN in a replayed record.
    inputs
        Inputs (nu,) that really acted; `sample.inputs` is what is known of them.
    faults
        Names of the injected faults that changed something in the interval.
    """

    sample: Sample
    outputs: FloatArray
    parameters: FloatArray
    inputs: FloatArray
    faults: tuple[str, ...] = ()


class Plant(Protocol[State]):
    """The process: simulated, or a replayed record."""

    def init(self) -> State:
        """State at the start."""
        ...

    def apply(self, state: State, inputs: FloatArray) -> tuple[State, PlantRecord]:
        """Hold the inputs (nu,) for one interval; disturbances among them are the plant's own."""
        ...


AnyPlant = Plant[Any]
