"""A value as a server tells it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Quality(Enum):
    """Status of a value: the two leading bits of an OPC UA status code (OPC 10000-4, 7.39)."""

    GOOD = "good"
    UNCERTAIN = "uncertain"
    BAD = "bad"


@dataclass(frozen=True)
class TagValue:
    """One value of a tag.

    Attributes
    ----------
    value
        The number, in the model's unit; NaN where the server tells none.
    quality
        Its status.
    source_time
        When it was taken, by the plant's clock [s].
    """

    value: float
    quality: Quality
    source_time: float
