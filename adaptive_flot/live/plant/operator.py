"""A simulated operator for demonstrations and tests: lets the link go to closed, and again after it has given up."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.live.safety.modes import Mode

PATIENCE, DOWN = 6, 3
"""Intervals that a link may stay in monitor or shed with the switch up; intervals that the switch then stays down."""
WAITING = ("", "off", "monitor", "shed")
"""Modes, as the link tells them, in which it waits for the operator."""


@dataclass(frozen=True)
class Operator:
    """How long the link has waited for the operator, in intervals."""

    waited: int = 0

    def next(self, link_mode: str) -> tuple[Operator, Mode]:
        """The operator after an interval, and where the switch stands now; `link_mode` is what the link tells."""
        if link_mode.split(":")[0] not in WAITING:
            return Operator(), Mode.CLOSED
        waited = self.waited + 1
        if waited >= PATIENCE + DOWN:
            return Operator(), Mode.CLOSED
        return Operator(waited), Mode.MONITOR if waited >= PATIENCE else Mode.CLOSED
