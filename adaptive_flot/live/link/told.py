"""What the plant has told: the newest value of each subscribed tag, and what it means to the model."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from asyncua import ua

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.link_keys import Scale
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.safety.tag_value import Quality, TagValue
from adaptive_flot.live.snapshot import Snapshot

HEARTBEAT = "plant_heartbeat"


@dataclass(frozen=True)
class Point:
    """A subscribed tag: its node, and how its numbers become the model's."""

    node: ua.NodeId
    scale: Scale = field(default_factory=Scale)
    delay_s: float = 0.0


class Told:
    """The newest value of each tag.

    Parameters
    ----------
    link
        The link file and its scenario.
    points
        The tags by name.

    Attributes
    ----------
    fresh
        Set by each new heartbeat of the plant.
    """

    def __init__(self, link: Link, points: Mapping[str, Point]) -> None:
        self.fresh = asyncio.Event()
        self._link, self._points = link, points
        self._told: dict[str, ua.DataValue] = {}
        self._beat: object = None

    def take(self, name: str | None, told: ua.DataValue) -> None:
        """Take the value of a tag; None is a tag that nobody has asked for."""
        if name is None:
            return
        self._told[name] = told
        if name == HEARTBEAT:
            beat = (told.Value.Value if told.Value is not None else None, told.SourceTimestamp)
            if beat != self._beat and told.StatusCode is not None and told.StatusCode.is_good():
                self._beat = beat
                self.fresh.set()

    def snapshot(self, alive: bool, in_time: bool, written: bool) -> Snapshot:
        """All of it by now; for the arguments see `Snapshot`."""
        time = _time(self._told.get(HEARTBEAT))
        operator = {
            name: (self._number(f"low {name}"), self._number(f"high {name}")) for name in self._link.file.writes
        }
        return Snapshot(
            time,
            alive and math.isfinite(time),
            {name: tag for name in self._link.file.tags if (tag := self._tag(name)) is not None},
            {name: tag for name in self._link.file.writes if (tag := self._tag(f"acting {name}")) is not None},
            operator,
            self._switch(),
            self._good("active") is True,
            in_time,
            written,
        )

    def _tag(self, name: str) -> TagValue | None:
        told = self._told.get(name)
        if told is None or told.StatusCode is None:
            return None
        point, code = self._points[name], told.StatusCode
        number = told.Value.Value if told.Value is not None else None
        value = float(number) if isinstance(number, (int, float)) else math.nan
        quality = Quality.GOOD if code.is_good() else Quality.UNCERTAIN if code.is_uncertain() else Quality.BAD
        return TagValue(point.scale.model(value), quality, _time(told) - point.delay_s)

    def _good(self, name: str) -> object:
        told = self._told.get(name)
        if told is None or told.StatusCode is None or not told.StatusCode.is_good() or told.Value is None:
            return None
        return told.Value.Value

    def _number(self, name: str) -> float:
        value = self._good(name)
        return self._points[name].scale.model(float(value)) if isinstance(value, (int, float)) else math.nan

    def _switch(self) -> Mode | None:
        value = self._good("switch")
        return Mode(value) if isinstance(value, int) and 0 <= value <= Mode.CLOSED else None


def _time(told: ua.DataValue | None) -> float:
    """Source time [s since 1970], NaN where there is none."""
    stamp = None if told is None else told.SourceTimestamp
    return math.nan if stamp is None else stamp.timestamp()
