"""Names, units and ranges of the test plant's tags, and who may write each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from adaptive_flot.live.plant.process import measured_outputs, write_limits
from adaptive_flot.runner.scenario.scenario import Scenario

NAMESPACE = "urn:adaptive-flot:test-plant"
Kind = Literal["measurement", "parameter", "acting", "remote", "local", "low", "high", "number", "flag", "text"]

PLANT_HEARTBEAT = "plant.heartbeat"
PLANT_ACTIVE = "plant.active"
SWITCH = "plant.switch"
LINK_HEARTBEAT = "link.heartbeat"
LINK_ASKS = "link.asks"
LINK_MODE = "link.mode"


@dataclass(frozen=True)
class Tag:
    """A tag of the test plant.

    Attributes
    ----------
    name
        Its node identifier in the plant's namespace.
    kind
        What it holds.
    unit
        Unit of the model, "-" for none.
    low, high
        Range of the instrument, in the unit.
    description
        In words.
    writer
        The user who may write it; empty for none.
    of
        Model quantity that it belongs to.
    """

    name: str
    kind: Kind
    unit: str = "-"
    low: float = 0.0
    high: float = 1.0
    description: str = ""
    writer: str = ""
    of: str = ""


def plant_tags(scenario: Scenario) -> list[Tag]:
    """All tags of a scenario's test plant."""
    model, limits = scenario.model, write_limits(scenario)
    tags = [
        Tag(q.name, "measurement", q.unit, q.lower, q.upper, q.description, of=q.name)
        for q in (*model.inputs, *(q for q in model.outputs if q.name in measured_outputs(scenario)))
    ]
    for i in scenario.measured_parameters:
        p = model.parameters[i]
        tags.append(
            Tag(f"parameter.{p.name}", "parameter", p.unit, p.lower, p.upper, f"measured parameter {p.name}", of=p.name)
        )
    for q in model.inputs:
        if q.name not in limits:
            continue
        own = limits[q.name]
        parts: tuple[tuple[Kind, str, str], ...] = (
            ("acting", "", "set-point that acts"),
            ("remote", "link", "set-point of the link"),
            ("local", "operator", "set-point of the operator"),
            ("low", "operator", "lower limit of the operator"),
            ("high", "operator", "upper limit of the operator"),
        )
        tags += [
            Tag(f"{q.name}.{kind}", kind, q.unit, own.low, own.high, f"{q.description}: {words}", writer, q.name)
            for kind, writer, words in parts
        ]
    return [
        *tags,
        Tag(PLANT_HEARTBEAT, "number", description="counts the plant's sampling intervals"),
        Tag(PLANT_ACTIVE, "flag", description="the link has control"),
        Tag(SWITCH, "number", high=3, description="0 off, 1 monitor, 2 advisory, 3 closed", writer="operator"),
        Tag(LINK_HEARTBEAT, "number", description="counts the link's cycles", writer="link"),
        Tag(LINK_ASKS, "flag", description="the link asks for control", writer="link"),
        Tag(LINK_MODE, "text", description="mode of the link, and why", writer="link"),
    ]
