"""Faults that a scenario injects between plant, estimator and controller: the entries of its `faults` list.

A fault acts while `from_s` <= t < `to_s`, t the time of a sample, for an actuator the start of an interval. Entries on
one output act in the order of the list, as a chain of instruments does.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class Period(BaseModel):
    """From when to when a fault acts [s]."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    from_s: float = Field(default=0.0, ge=0)
    to_s: float | None = None
    """Default the end of the run."""

    @model_validator(mode="after")
    def _order(self) -> Period:
        if self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError("to_s must lie after from_s")
        return self

    def acts(self, time: float) -> bool:
        """Whether the fault acts at a time [s]."""
        return self.from_s - 1e-9 <= time and (self.to_s is None or time < self.to_s - 1e-9)


class Missing(Period):
    """A share of the measurements of an output does not come."""

    fault: Literal["missing"]
    output: str
    rate: float = Field(default=1.0, gt=0, le=1)

    def alter(self, value: float, frozen: float, draws: tuple[float, float]) -> float:
        """The value that is shown for a measured one; draws are uniform in [0, 1)."""
        del frozen
        return math.nan if draws[0] < self.rate else value


class Outliers(Period):
    """A share of the measurements is off by `size`, in the output's unit, up or down."""

    fault: Literal["outliers"]
    output: str
    rate: float = Field(gt=0, le=1)
    size: float

    def alter(self, value: float, frozen: float, draws: tuple[float, float]) -> float:
        """The value that is shown for a measured one; draws are uniform in [0, 1)."""
        del frozen
        if draws[0] >= self.rate:
            return value
        return value + (self.size if draws[1] < 0.5 else -self.size)


class Frozen(Period):
    """An instrument repeats the last value that it showed before."""

    fault: Literal["frozen"]
    output: str

    def alter(self, value: float, frozen: float, draws: tuple[float, float]) -> float:
        """The value that is shown for a measured one; `frozen` is the last one shown before, NaN if none was."""
        del value, draws
        return frozen


class SlowAnalyser(Period):
    """An output comes from an analyser (or the laboratory) every `every_s` only, known `dead_time_s` later."""

    fault: Literal["slow_analyser"]
    output: str
    every_s: float = Field(default=300.0, gt=0)
    dead_time_s: float = Field(default=0.0, ge=0)


class Stuck(Period):
    """An actuator stays where it was whatever is asked of it; `measured`: a flow meter shows what really flows."""

    fault: Literal["stuck"]
    input: str
    measured: bool = False


class SolverFailure(Period):
    """The controller's optimisations fail."""

    fault: Literal["solver_failure"]


class NanState(Period):
    """The state estimate that the controller gets is not a number."""

    fault: Literal["nan_state"]


SensorFault = Missing | Outliers | Frozen
PlantFault = Missing | Outliers | Frozen | SlowAnalyser | Stuck
ControllerFault = SolverFailure | NanState
Fault = Annotated[PlantFault | ControllerFault, Field(discriminator="fault")]
