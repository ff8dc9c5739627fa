"""What a cycle looks like from outside: all that program and page show of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from adaptive_flot.greybox.model import Model
from adaptive_flot.live.alarms import Alarms
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.samples import Histories
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.requests import Answered
from adaptive_flot.live.safety.modes import ModeState
from adaptive_flot.live.shadow.process import ShadowView
from adaptive_flot.live.snapshot import Snapshot


class Stage(Enum):
    """How far a person has gone with what discovery found."""

    FOUND = "found"
    SHADOW = "in shadow"
    BUILDING = "is being applied"
    APPLIED = "applied"
    REVERTED = "reverted"


@dataclass(frozen=True)
class Card:
    """What discovery found, and what a person made of it.

    Attributes
    ----------
    finding
        What was found.
    since
        Plant's time when it was found [s].
    stage
        What was made of it.
    by
        Who went to this stage last; empty for nobody.
    errors
        (output, error before, error after) in shadow on the rows since, when it was applied.
    """

    finding: Finding
    since: float
    stage: Stage = Stage.FOUND
    by: str = ""
    errors: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Progress:
    """A cycle from outside.

    Attributes
    ----------
    snapshot, outcome
        What the plant told, and what the cycle came to.
    seconds
        Time of the cycle [s].
    found
        What discovery says; empty for nothing.
    connected
        There is a connection to the plant's server.
    modes
        State of the mode machine.
    histories
        What the checks know of each tag.
    model
        The model in use.
    alarms, card, shadows, answered
        See `Desk`.
    extended
        The model in use is longer than the scenario's.
    unreachable
        Why the last attempt to connect failed, in words; empty where there is a connection, or none was tried.
    """

    snapshot: Snapshot
    outcome: Outcome
    seconds: float
    found: str
    connected: bool
    modes: ModeState
    histories: Histories
    model: Model
    alarms: Alarms = field(default_factory=dict)
    card: Card | None = None
    shadows: Mapping[str, ShadowView] = field(default_factory=dict)
    answered: tuple[Answered, ...] = ()
    extended: bool = False
    unreachable: str = ""
