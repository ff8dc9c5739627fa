"""The parts of a link file: server, tags, writes, handshake, cycle, page, shadows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from adaptive_flot.live.safety.checks import TagRules
from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.records.map_values import Duration
from adaptive_flot.records.tag_map import TagKeys
from adaptive_flot.records.units import convert, seconds

MODES = {"off": Mode.OFF, "monitor": Mode.MONITOR, "advisory": Mode.ADVISORY, "closed": Mode.CLOSED}
Seconds = Annotated[float, Field(gt=0)]


class Part(BaseModel):
    """A part of a link file: no unknown keys, no infinities."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ServerPart(Part):
    """The OPC UA server: its address, the security policy (always sign and encrypt), and who logs in."""

    url: str
    security: Literal["Aes256Sha256RsaPss", "Basic256Sha256"] = "Aes256Sha256RsaPss"
    certificate: str
    key: str
    server_certificate: str
    user: str
    password_file: str
    namespace: str = ""
    """Namespace URI of tags that are given by name alone."""
    timeout_s: Seconds = 2.0
    """A server that does not answer for so long counts as lost."""


@dataclass(frozen=True)
class Scale:
    """A tag's unit as the model's: model value = offset + factor times tag value."""

    offset: float = 0.0
    factor: float = 1.0

    @classmethod
    def of(cls, unit: str | None, wanted: str) -> Scale:
        """Scale of a unit; DataError where it does not fit the wanted one. None is the wanted one."""
        if unit is None:
            return cls()
        zero, one = convert(np.array([0.0, 1.0]), unit, wanted)
        return cls(float(zero), float(one - zero))

    def model(self, value: float) -> float:
        """A tag's value in the model's unit."""
        return self.offset + self.factor * value

    def tag(self, value: float) -> float:
        """A model's value in the tag's unit."""
        return (value - self.offset) / self.factor


class LiveTag(TagKeys):
    """A measured quantity: the keys of the map of `import`, and what only a live value needs.

    Attributes
    ----------
    stale
        Age from which the last value no longer counts. Longer than the time between two values of an analyser.
    jump
        Largest change from one value to the next, in the tag's unit; default no check.
    """

    stale: Duration = "10 s"
    jump: Annotated[float, Field(gt=0)] | None = None

    def rules(self, scale: Scale, low: float, high: float) -> TagRules:
        """What is asked of the tag, in the model's unit, where the model's range is [low, high]."""
        if self.range is not None:
            low, high = sorted(scale.model(v) for v in self.range)
        return TagRules(
            low,
            high,
            seconds(self.stale),
            math.inf if self.frozen_s is None else self.frozen_s,
            math.inf if self.jump is None else abs(scale.factor) * self.jump,
            tuple(scale.model(float(code)) for code in self.bad if _is_number(code)),
        )


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


class WritePart(Part):
    """One input that is written: tags, clamps, and the largest change an interval; numbers in the model's unit."""

    tag: str
    unit: str | None = None
    """Unit of the tags; default the model's."""
    read_back: str
    """Tag of the set-point that acts."""
    low: float
    high: float
    rate: Seconds
    operator_low: str | None = None
    operator_high: str | None = None

    @model_validator(mode="after")
    def _order(self) -> WritePart:
        if not self.low < self.high:
            raise ValueError("low must lie below high")
        return self

    @property
    def limit(self) -> WriteLimit:
        """Clamps and rate limit."""
        return WriteLimit(self.low, self.high, self.rate)


class HandshakePart(Part):
    """Tags by which plant and link know of each other."""

    plant_heartbeat: str
    active: str
    switch: str
    link_heartbeat: str
    asks: str
    mode: str | None = None


class CyclePart(Part):
    """How patient the link is, and how much faster than real time the plant runs (test plants only)."""

    shed_after: int = Field(default=3, ge=1, le=10)
    handshake_cycles: int = Field(default=10, ge=1)
    longest_gap_s: Seconds = 60.0
    """A longer gap in the samples starts the estimator again from its last estimate."""
    deadline: float = Field(default=0.8, gt=0, lt=1)
    """Share of the sampling interval after which nothing is written any more in a cycle."""
    ends_after_s: float = Field(default=60.0, gt=0)
    """A cycle that lasts longer [s of this machine] ends the program; the first fit has 15 times as long."""
    speed: float = Field(default=1.0, gt=0, le=1000)


class PagePart(Part):
    """Where the page of the control room is served, and who may see it and act at it."""

    host: str = "127.0.0.1"
    port: int = Field(default=8050, ge=0, le=65535)
    """0: any that is free; it is said at the start."""
    names: tuple[str, ...] = ()
    """Further names under which browsers reach the page, as `cell7.plant.example`."""
    view_token_file: str
    """File of the token for viewing."""
    act_token_file: str
    """File of the token for acting."""
    certificate: str | None = None
    key: str | None = None
    """Certificate and key (PEM) for https. Another address than this machine's own needs them."""

    @model_validator(mode="after")
    def _encrypted(self) -> PagePart:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key go together: give both")
        if self.host not in LOOPBACK and self.certificate is None:
            raise ValueError(f"host {self.host!r} opens the page to the network: give certificate and key")
        return self


LOOPBACK = ("127.0.0.1", "localhost", "::1")


class ShadowPart(Part):
    """An estimator, and maybe a controller, of the scenario that run beside the acting ones and write nothing."""

    estimator: str
    controller: str | None = None
