"""How inputs and plant parameters move over a run: small typed descriptions that turn into one value an interval."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.scenario.inputs.random_streams import Stream, generator
from adaptive_flot.runner.scenario.inputs.recorded import Recorded

LARGEST_CHANGE = 9.0
"""A larger share was meant as percent: no physical parameter drifts to more than ten times its value."""


class _Profile(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False)


class Constant(_Profile):
    """One value throughout."""

    profile: Literal["constant"]
    value: float

    def values(self, time: FloatArray, seed: int) -> FloatArray:
        """Value held in the interval that starts at each time [s] (N,)."""
        del seed
        return np.full(len(time), self.value)


class Staircase(_Profile):
    """Equal steps from one value to another over the whole run."""

    profile: Literal["staircase"]
    start: float = Field(alias="from")
    stop: float = Field(alias="to")
    every_s: float = Field(gt=0)

    def values(self, time: FloatArray, seed: int) -> FloatArray:
        """Value held in the interval that starts at each time [s] (N,)."""
        del seed
        block = np.floor(time / self.every_s + 1e-9).astype(int)
        steps = max(int(block[-1]), 1)
        return self.start + (self.stop - self.start) * block / steps


class Random(_Profile):
    """Uniformly random level, redrawn at a fixed period."""

    profile: Literal["random"]
    between: tuple[float, float]
    every_s: float = Field(gt=0)
    seed: Annotated[int, Field(ge=0)] | Literal["per_run"]
    """A number fixes the sequence for all runs; `per_run` draws another one for each run seed."""

    @model_validator(mode="after")
    def _order(self) -> Random:
        if self.between[0] > self.between[1]:
            raise ValueError("between must name the lower value first")
        return self

    def values(self, time: FloatArray, seed: int) -> FloatArray:
        """Value held in the interval that starts at each time [s] (N,)."""
        draw = generator(seed, Stream.INPUT_OF_RUN) if self.seed == "per_run" else generator(self.seed, Stream.INPUT)
        block = np.floor(time / self.every_s + 1e-9).astype(int)
        levels: FloatArray = draw.uniform(*self.between, size=int(block[-1]) + 1)
        return np.take(levels, block)


class Steps(_Profile):
    """Given values from given times on."""

    profile: Literal["steps"]
    at_s: list[float]
    values_: list[float] = Field(alias="values")

    @model_validator(mode="after")
    def _lengths(self) -> Steps:
        if len(self.at_s) != len(self.values_) or self.at_s[:1] != [0.0] or self.at_s != sorted(set(self.at_s)):
            raise ValueError("at_s must rise from 0 and have as many entries as values")
        return self

    def values(self, time: FloatArray, seed: int) -> FloatArray:
        """Value held in the interval that starts at each time [s] (N,)."""
        del seed
        return np.array(self.values_)[np.searchsorted(self.at_s, time + 1e-9, side="right") - 1]


class Change(_Profile):
    """A parameter that leaves its nominal value by a share of it: as a ramp, or as a step at the start of the ramp."""

    profile: Literal["ramp", "step"] = "ramp"
    change: float
    from_s: float = Field(ge=0)
    to_s: float

    @model_validator(mode="after")
    def _order(self) -> Change:
        if self.to_s <= self.from_s:
            raise ValueError("to_s must lie after from_s")
        if abs(self.change) > LARGEST_CHANGE:
            raise ValueError(
                f"change is a share, and {self.change:g} makes the value {1 + self.change:g} times as large; write "
                f"{self.change / 100:g} for {self.change:g} %, or give 'profile: factors'"
            )
        return self

    def factor(self, time: FloatArray, seed: int = 0, name: str = "") -> FloatArray:
        """Factor on the nominal value in the interval that starts at each time [s] (N,)."""
        del seed, name
        if self.profile == "step":
            share = (time >= self.from_s - 1e-9).astype(float)
        else:
            share = np.clip((time - self.from_s) / (self.to_s - self.from_s), 0.0, 1.0)
        return 1.0 + self.change * share


class Factors(_Profile):
    """A parameter at given multiples of its nominal value from given times on."""

    profile: Literal["factors"]
    at_s: list[float]
    factors: list[float]

    @model_validator(mode="after")
    def _lengths(self) -> Factors:
        if len(self.at_s) != len(self.factors) or self.at_s[:1] != [0.0] or self.at_s != sorted(set(self.at_s)):
            raise ValueError("at_s must rise from 0 and have as many entries as factors")
        return self

    def factor(self, time: FloatArray, seed: int = 0, name: str = "") -> FloatArray:
        """Factor on the nominal value in the interval that starts at each time [s] (N,)."""
        del seed, name
        return np.array(self.factors)[np.searchsorted(self.at_s, time + 1e-9, side="right") - 1]


class RandomWalk(_Profile):
    """A parameter whose logarithm does a random walk in continuous time, held during each interval."""

    profile: Literal["random_walk"]
    share_per_hour: float = Field(gt=0)
    """Standard deviation of the walk after an hour, as a share of the parameter."""
    from_s: float = Field(default=0.0, ge=0)
    """The parameter is at its nominal value until then."""
    seed: Annotated[int, Field(ge=0)] | Literal["per_run"] = "per_run"
    """A number fixes the walk for all runs; `per_run` draws another one for each run seed."""

    def factor(self, time: FloatArray, seed: int = 0, name: str = "") -> FloatArray:
        """Factor on the nominal value in the interval that starts at each time [s] (N,); another walk for each name."""
        if self.seed == "per_run":
            draw = generator(seed, Stream.RANDOM_WALK_OF_RUN, *name.encode())
        else:
            draw = generator(self.seed, Stream.RANDOM_WALK, *name.encode())
        walk = np.zeros(len(time))
        moves = draw.standard_normal(len(time) - 1) * np.sqrt(np.diff(time) / 3600.0)
        walk[1:] = self.share_per_hour * np.cumsum(np.where(time[1:] >= self.from_s - 1e-9, moves, 0.0))
        return np.exp(walk)


class FeedWalk(_Profile):
    """What wanders about its planned or nominal value: the logarithm of its factor is an Ornstein-Uhlenbeck process.

    ``dX = -X / tau dt + s sqrt(2 / tau) dW`` with X = 0 at the start, held during each interval; s is `share` and tau
    `correlation_s`. Gillespie, *Physical Review E* 54 (1996) 2084, equation 2.1.
    """

    share: float = Field(gt=0, le=1)
    """Standard deviation that it comes to, as a share."""
    correlation_s: float = Field(gt=0)
    """Time after which little is left of where it was [s]."""
    seed: Annotated[int, Field(ge=0)] | Literal["per_run"] = "per_run"
    """A number fixes the walk for all runs; `per_run` draws another one for each run seed."""

    def factor(self, time: FloatArray, seed: int = 0, name: str = "") -> FloatArray:
        """Factor in the interval that starts at each time [s] (N,); another walk for each name."""
        own = seed if self.seed == "per_run" else self.seed
        stream = Stream.FEED_WALK_OF_RUN if self.seed == "per_run" else Stream.FEED_WALK
        drawn = generator(own, stream, *name.encode()).standard_normal(len(time) - 1)
        kept = np.exp(-np.diff(time) / self.correlation_s)
        walk = np.zeros(len(time))
        for k in range(1, len(time)):
            walk[k] = kept[k - 1] * walk[k - 1] + self.share * np.sqrt(1 - kept[k - 1] ** 2) * drawn[k - 1]
        return np.exp(walk)


InputProfile = Annotated[Constant | Staircase | Random | Steps | Recorded, Field(discriminator="profile")]


def profile(given: object) -> str:
    """Kind of a parameter's profile, by which pydantic chooses; one that says none is a ramp."""
    kind = given.get("profile", "ramp") if isinstance(given, dict) else getattr(given, "profile", "ramp")
    return str(kind)


ParameterProfile = Annotated[
    Annotated[Change, Tag("ramp")]
    | Annotated[Change, Tag("step")]
    | Annotated[Factors, Tag("factors")]
    | Annotated[RandomWalk, Tag("random_walk")],
    Discriminator(profile),
]
