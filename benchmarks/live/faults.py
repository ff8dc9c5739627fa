"""What fails when: drawn once from a seed, so that a run can be repeated."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from adaptive_flot.live.safety.tag_value import Quality, TagValue

Instrument = Literal["bad", "uncertain", "nan", "out of range", "silent", "frozen", "jump"]
INSTRUMENT: tuple[Instrument, ...] = ("bad", "uncertain", "nan", "out of range", "silent", "frozen", "jump")
NEVER_TRUE = ("bad", "uncertain", "nan", "out of range")
"""Faults after which no value of the tag may be used."""
Event = Literal["hung server", "overrun", "write refused", "clock jump", "link killed", "server killed"]
EVENTS: tuple[Event, ...] = ("hung server", "overrun", "write refused", "clock jump", "link killed", "server killed")
TAG_RATE, EVENT_RATE = 5e-4, 5e-3
"""Probability an interval that a fault of a tag, or an event, begins."""
MEAN_LENGTH = 8
FAR = 1e6
"""Added to a value that leaves every range."""


@dataclass
class InstrumentFaults:
    """Faults of tags; as `distort` of a `DirectPlant` it remembers what each tag told.

    Attributes
    ----------
    acting
        The fault of each tag in this interval.
    good_at
        When each tag last told a good new value [s].
    """

    generator: np.random.Generator
    acting: dict[str, Instrument] = field(default_factory=dict)
    until: dict[str, int] = field(default_factory=dict)
    last: dict[str, float] = field(default_factory=dict)
    good_at: dict[str, float] = field(default_factory=dict)
    counted: dict[str, int] = field(default_factory=dict)

    def __call__(self, name: str, tag: TagValue, row: int) -> TagValue | None:
        """What the tag tells in this interval."""
        if self.until.get(name, 0) <= row:
            self.acting.pop(name, None)
            if self.generator.random() < TAG_RATE:
                kind = INSTRUMENT[self.generator.integers(len(INSTRUMENT))]
                self.acting[name], self.until[name] = kind, row + 1 + self.generator.geometric(1 / MEAN_LENGTH)
                self.counted[kind] = self.counted.get(kind, 0) + 1
        told = self._told(name, tag)
        if told is not None and self.acting.get(name) not in NEVER_TRUE:
            self.good_at[name] = told.source_time
            self.last[name] = told.value
        return told

    def _told(self, name: str, tag: TagValue) -> TagValue | None:
        kind = self.acting.get(name)
        if kind == "bad":
            return replace(tag, quality=Quality.BAD)
        if kind == "uncertain":
            return replace(tag, quality=Quality.UNCERTAIN)
        if kind == "nan":
            return replace(tag, value=math.nan)
        if kind == "out of range":
            return replace(tag, value=tag.value + FAR)
        if kind == "silent":
            return None
        if kind == "frozen":
            return replace(tag, value=self.last.get(name, tag.value))
        return replace(tag, value=1.3 * tag.value) if kind == "jump" else tag


def draw_event(generator: np.random.Generator) -> tuple[Event, int] | None:
    """An event that begins in this interval, and how many intervals it lasts."""
    if generator.random() >= EVENT_RATE:
        return None
    return EVENTS[generator.integers(len(EVENTS))], int(generator.geometric(1 / 4))
