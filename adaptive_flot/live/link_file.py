"""The keys of a link file: which scenario, which server, which tags, and what may be written."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from adaptive_flot.errors import DataError, LinkError, near_match
from adaptive_flot.greybox.quantities import Parameter, Quantity
from adaptive_flot.live.safety.checks import TagRules
from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.live.safety.modes import Mode, ModeRules
from adaptive_flot.records.map_values import Duration
from adaptive_flot.records.tag_map import TagKeys
from adaptive_flot.records.units import convert, seconds
from adaptive_flot.runner.scenario.loading import load_scenario, shipped_scenarios
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.yaml_files import read_yaml
from adaptive_flot.yaml_problems import first_problem

MODES = {"off": Mode.OFF, "monitor": Mode.MONITOR, "advisory": Mode.ADVISORY, "closed": Mode.CLOSED}
Seconds = Annotated[float, Field(gt=0)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ServerPart(_Part):
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


class WritePart(_Part):
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


class HandshakePart(_Part):
    """Tags by which plant and link know of each other."""

    plant_heartbeat: str
    active: str
    switch: str
    link_heartbeat: str
    asks: str
    mode: str | None = None


class CyclePart(_Part):
    """How patient the link is, and how much faster than real time the plant runs (test plants only)."""

    shed_after: int = Field(default=3, ge=1, le=10)
    handshake_cycles: int = Field(default=10, ge=1)
    longest_gap_s: Seconds = 60.0
    """A longer gap in the samples starts the estimator again from its last estimate."""
    deadline: float = Field(default=0.8, gt=0, lt=1)
    """Share of the sampling interval after which nothing is written any more in a cycle."""
    speed: float = Field(default=1.0, gt=0, le=1000)


class LinkFile(_Part):
    """Keys of a link file."""

    scenario: str
    """Scenario file, or shipped name: model, estimators, controllers, limits, prices; never its plant."""
    estimator: str
    controller: str
    highest_mode: Literal["monitor", "advisory", "closed"] = "advisory"
    database: str = "sqlite:///live.sqlite"
    server: ServerPart
    tags: dict[str, LiveTag]
    writes: dict[str, WritePart]
    handshake: HandshakePart
    cycle: CyclePart = CyclePart()

    @property
    def mode_rules(self) -> ModeRules:
        """How patient the state machine is."""
        return ModeRules(MODES[self.highest_mode], self.cycle.shed_after, self.cycle.handshake_cycles)


class Link(BaseModel):
    """A link file with the scenario that it names."""

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)

    path: Path
    file: LinkFile
    scenario: Scenario

    def beside(self, name: str) -> Path:
        """A file named in the link file: beside it where the path is relative."""
        return self.path.parent / name


def tagged_quantities(scenario: Scenario) -> dict[str, Quantity | Parameter]:
    """What may have a tag, by name: inputs, outputs, and measured parameters as `parameter.<full name>`."""
    model = scenario.model
    found: dict[str, Quantity | Parameter] = {q.name: q for q in (*model.inputs, *model.outputs)}
    return found | {f"parameter.{model.parameters[i].name}": model.parameters[i] for i in scenario.measured_parameters}


def load_link(path: Path) -> Link:
    """Read and check a link file.

    Raises
    ------
    LinkError
        Unknown key, wrong type, a quantity without tag or that the model does not have, a unit that is not the model's,
        clamps outside the scenario's limits.
    ScenarioError
        The scenario can not be used.
    """
    content = read_yaml(path, LinkError, "holds no keys; write one with `adaptive-flot serve-plant --write-link`")
    try:
        file = LinkFile.model_validate(content)
    except ValidationError as error:
        raise LinkError(f"{path}: {first_problem(error, LinkFile)}") from error
    beside = path.parent / file.scenario
    scenario = load_scenario(file.scenario if file.scenario in shipped_scenarios() else beside)
    _check(path, file, scenario)
    return Link(path=path, file=file, scenario=scenario)


def _check(path: Path, file: LinkFile, scenario: Scenario) -> None:
    model, limits = scenario.model, scenario.limits
    known = tagged_quantities(scenario)
    for name, tag in file.tags.items():
        if name not in known:
            raise LinkError(f"{path}: tags: the model has no {name!r}; {near_match(name, known)}")
        try:
            Scale.of(tag.unit, known[name].unit)
        except DataError as error:
            raise LinkError(f"{path}: tags.{name}: {error}") from error
    for name in (*model.names("inputs"), *scenario.setup.outputs):
        if name not in file.tags:
            raise LinkError(f"{path}: tags: {name!r} has no tag; the estimator needs one")
    if limits is None:
        raise LinkError(f"{path}: scenario {scenario.name!r} has no limits; a controller needs them")
    if set(file.writes) != set(limits.inputs):
        raise LinkError(f"{path}: writes: give one for each of {', '.join(limits.inputs)}, and for no other input")
    for name, write in file.writes.items():
        try:
            Scale.of(write.unit, known[name].unit)
        except DataError as error:
            raise LinkError(f"{path}: writes.{name}: {error}") from error
        low, high = limits.inputs[name]
        if write.low < low or write.high > high:
            raise LinkError(
                f"{path}: writes.{name}: clamps [{write.low:g}, {write.high:g}] are wider than the scenario's "
                f"limits [{low:g}, {high:g}]; narrow them"
            )
    if file.estimator not in scenario.file.estimators or file.controller not in scenario.file.controllers:
        raise LinkError(
            f"{path}: scenario {scenario.name!r} has estimators {', '.join(scenario.file.estimators)} and controllers "
            f"{', '.join(scenario.file.controllers)}; name one of each"
        )
    if scenario.file.estimators[file.estimator].needs_truth(scenario.path.parent):
        raise LinkError(f"{path}: estimator {file.estimator!r} needs the true parameters, which no plant tells")
