"""What a cycle came to: what is stored, and what is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from adaptive_flot.contracts import Decision, Estimate, Sample
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.safety.modes import Mode


@dataclass(frozen=True)
class Outcome:
    """What a cycle came to: what is stored, and what is written.

    Attributes
    ----------
    number
        Number of the cycle, from 1.
    mode, reason
        Mode after the cycle, and why it changed; empty where it did not.
    faults
        What makes the cycle a bad one.
    checks
        What each value was found to be.
    sample, estimate, decision
        None where there was none in this cycle.
    writes
        Set-points to write, by input, in the model's unit.
    acting
        Set-point that acts by input, NaN where it is not known.
    asks_control
        The link tells the plant that it wants control.
    """

    number: int
    mode: Mode
    reason: str
    faults: tuple[str, ...]
    checks: Mapping[str, Check]
    sample: Sample | None
    estimate: Estimate | None
    decision: Decision | None
    writes: Mapping[str, float]
    acting: Mapping[str, float]
    asks_control: bool


@dataclass(frozen=True)
class Written:
    """What came of a write: what was asked, what was read back, and what went wrong (empty: nothing)."""

    value: float
    read_back: float
    problem: str = ""
