"""What the plant told by the begin of a cycle: all that a cycle depends on, so that it can be replayed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.safety.tag_value import TagValue


@dataclass(frozen=True)
class Snapshot:
    """What the plant told.

    Attributes
    ----------
    time
        Time of the newest sample, by the plant's clock [s].
    alive
        There is a new sample since the last cycle.
    tags
        Newest value of each measured quantity, by name.
    acting
        Set-point that acts, by input.
    operator
        The operator's limits (low, high) by input; NaN for none.
    switch
        The operator's switch; None where it can not be read.
    granted
        The plant says that the link has control.
    in_time
        The cycle before ended before its deadline.
    written
        What the cycle before wrote was taken and read back.
    allowed
        How far a person at the page of the link lets it go.
    """

    time: float
    alive: bool
    tags: Mapping[str, TagValue]
    acting: Mapping[str, TagValue]
    operator: Mapping[str, tuple[float, float]]
    switch: Mode | None
    granted: bool
    in_time: bool = True
    written: bool = True
    allowed: Mode = Mode.CLOSED

    def permitted(self, mode: Mode) -> Mode | None:
        """The lower one of the operator's switch and the page's, in a mode.

        Where the operator's can not be read, the page's only lowers the mode; None where it does not.
        """
        if self.switch is None:
            return self.allowed if self.allowed < min(mode, Mode.CLOSED) else None
        return min(self.switch, self.allowed)
