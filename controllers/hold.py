"""Hold the first planned inputs: the smallest closed-loop baseline."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.contracts import ControllerSetup, Decision, Estimate, Sample, Status


@dataclass(frozen=True)
class HoldState:
    """Nothing changes from step to step; the time [s] of the start is kept for the record."""

    start: float


class Hold:
    """Holds the first row of `setup.schedule` (N, nu) for ever.

    Parameters
    ----------
    setup
        Model, sampling interval and planned inputs.
    """

    def __init__(self, setup: ControllerSetup) -> None:
        self.setup = setup

    def init(self, time: float) -> HoldState:
        """Start at a time [s]."""
        return HoldState(time)

    def decide(self, state: HoldState, sample: Sample | None, estimate: Estimate | None) -> tuple[HoldState, Decision]:
        """Inputs of the next interval; measurement and estimate are not used."""
        del sample, estimate
        return state, Decision(self.setup.schedule[0].copy(), Status.OK, "hold")
