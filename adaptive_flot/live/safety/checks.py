"""Which values count as measurements. A value that fails a check is a missing measurement, never a wrong one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

from adaptive_flot.live.safety.tag_value import Quality, TagValue

SAME_LEVEL = 3
"""Values in a row that agree with each other after a jump are believed: the process did move."""


class Check(Enum):
    """What a value was found to be; only `OK` is a measurement."""

    OK = "ok"
    ABSENT = "no value yet"
    OLD = "no new value"
    STALE = "stale: no new value for too long"
    BAD = "status Bad"
    UNCERTAIN = "status Uncertain"
    BAD_CODE = "a number that stands for a bad value"
    OUT_OF_RANGE = "outside its range"
    JUMP = "jumped further than the process can"
    FROZEN = "frozen: repeats itself to the bit"
    BACKWARD = "older than the value before"
    FUTURE = "taken in the future"


@dataclass(frozen=True)
class TagRules:
    """What is asked of a tag.

    Attributes
    ----------
    low, high
        Range of a credible value, in the model's unit.
    stale_after_s
        Age from which the last value no longer says what is [s].
    frozen_after_s
        How long new values may repeat themselves to the bit [s]; infinite for set-points.
    largest_jump
        Largest change from one believed value to the next, in the unit; infinite for no check.
    bad
        Numbers that stand for a bad value (-9999).
    """

    low: float = -math.inf
    high: float = math.inf
    stale_after_s: float = 10.0
    frozen_after_s: float = math.inf
    largest_jump: float = math.inf
    bad: tuple[float, ...] = ()


@dataclass(frozen=True)
class TagHistory:
    """What the next check needs: last believed value, last shown one, and values in a row after a jump.

    Attributes
    ----------
    believed, believed_at
        Last value that passed, and when it was taken [s]; NaN before the first.
    seen_at
        When the newest value of any kind was taken [s].
    shown, since
        Last number shown, and since when it is shown [s].
    jumped, agreeing
        First value after a jump, and how many in a row agree with it.
    """

    believed: float = math.nan
    believed_at: float = -math.inf
    seen_at: float = -math.inf
    shown: float = math.nan
    since: float = math.nan
    jumped: float = math.nan
    agreeing: int = 0

    def held(self, rules: TagRules, now: float) -> float:
        """Last believed value while it is not stale, NaN after."""
        return self.believed if now - self.believed_at <= rules.stale_after_s else math.nan


def check(rules: TagRules, history: TagHistory, tag: TagValue | None, now: float) -> tuple[TagHistory, Check]:
    """Check the newest value of a tag.

    Parameters
    ----------
    rules
        What is asked of it.
    history
        What the last check left.
    tag
        The newest value that the server told; None before the first.
    now
        The plant's time [s].

    Returns
    -------
    history
        For the next check; its `believed` is this value where the check is `OK`.
    result
        What the value was found to be.
    """
    if tag is None:
        return history, Check.ABSENT
    age = now - tag.source_time
    if not math.isfinite(tag.source_time) or -age > rules.stale_after_s:
        return history, Check.FUTURE
    if tag.source_time < history.seen_at:
        return history, Check.BACKWARD
    if tag.source_time == history.seen_at and tag.quality is not Quality.BAD:
        return history, Check.STALE if now - history.believed_at > rules.stale_after_s else Check.OLD
    found = _of_itself(rules, tag, age)
    if found is Check.BAD or found is Check.BAD_CODE or not math.isfinite(tag.value):
        return replace(history, seen_at=tag.source_time), found
    since = history.since if tag.value == history.shown else tag.source_time
    history = replace(history, seen_at=tag.source_time, shown=tag.value, since=since)
    if found is Check.OK and tag.source_time - since > rules.frozen_after_s - 1e-9:
        found = Check.FROZEN
    if found is not Check.OK:
        return history, found
    return _jump(rules, history, tag)


def _of_itself(rules: TagRules, tag: TagValue, age: float) -> Check:
    if tag.quality is Quality.BAD or not math.isfinite(tag.value):
        return Check.BAD
    if tag.quality is Quality.UNCERTAIN:
        return Check.UNCERTAIN
    if tag.value in rules.bad:
        return Check.BAD_CODE
    if not rules.low <= tag.value <= rules.high:
        return Check.OUT_OF_RANGE
    return Check.STALE if age > rules.stale_after_s else Check.OK


def _jump(rules: TagRules, history: TagHistory, tag: TagValue) -> tuple[TagHistory, Check]:
    """A jump is believed once the values after it agree with each other."""
    moved = abs(tag.value - history.believed)
    if moved > rules.largest_jump:
        agrees = abs(tag.value - history.jumped) <= rules.largest_jump
        agreeing = history.agreeing + 1 if agrees else 1
        if agreeing < SAME_LEVEL:
            first = history.jumped if agrees else tag.value
            return replace(history, jumped=first, agreeing=agreeing), Check.JUMP
    believed = replace(history, believed=tag.value, believed_at=tag.source_time, jumped=math.nan, agreeing=0)
    return believed, Check.OK
