"""Clamps and rate limits of what is written: kept by the link, and by the test plant once more."""

from __future__ import annotations

import math
from dataclasses import dataclass

ROUNDING = 1e-9
"""Share of a range or a rate by which a number may miss it: sums of floating-point numbers do."""


@dataclass(frozen=True)
class WriteLimit:
    """Where an input may be put, and how fast.

    Attributes
    ----------
    low, high
        Clamps, in the input's unit.
    rate
        Largest change an interval, in the unit.
    """

    low: float
    high: float
    rate: float

    def within(self, low: float, high: float) -> WriteLimit:
        """These limits inside those of the operator; NaN is no limit."""
        return WriteLimit(
            self.low if math.isnan(low) else max(self.low, low),
            self.high if math.isnan(high) else min(self.high, high),
            self.rate,
        )

    def refusal(self, value: float, acting: float) -> str:
        """Why a value must not be written while another one acts; empty where it may be.

        Parameters
        ----------
        value
            What would be written, in the unit.
        acting
            What acts now, in the unit.
        """
        if not math.isfinite(value):
            return "not a finite number"
        if not math.isfinite(acting):
            return "the value that acts is not known"
        if not self.low <= value <= self.high:
            return f"outside [{self.low:g}, {self.high:g}]"
        if abs(value - acting) > self.rate * (1 + ROUNDING) + ROUNDING * abs(acting):
            return f"a change of {value - acting:g} is faster than {self.rate:g} an interval"
        return ""

    def towards(self, target: float, acting: float) -> float | None:
        """The value to write on the way from what acts to a target; None where none may be written.

        None: a number is not finite, the clamps leave no room, or what acts is further outside them than one interval.
        """
        if not (math.isfinite(target) and math.isfinite(acting) and self.low <= self.high):
            return None
        clamped = min(max(target, self.low), self.high)
        value = min(max(clamped, acting - self.rate), acting + self.rate)
        return None if self.refusal(value, acting) else value
