"""Open loop: plays a table of inputs. With it the runner reproduces the paper's scenarios."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Decision, DecisionTable, Estimate, Sample, Status


@dataclass(frozen=True)
class ScheduleState:
    """Row of the table to play next."""

    row: int


class Schedule:
    """Plays `setup.schedule` (N, nu) row by row and holds the last row after its end.

    Parameters
    ----------
    setup
        Model, sampling interval and the table of planned inputs.
    """

    open_loop = True

    def __init__(self, setup: ControllerSetup) -> None:
        self.setup = setup

    def init(self, time: float) -> ScheduleState:
        """Start at the first row."""
        del time  # the table starts with the run
        return ScheduleState(0)

    def decide(
        self, state: ScheduleState, sample: Sample | None, estimate: Estimate | None
    ) -> tuple[ScheduleState, Decision]:
        """Inputs of the next interval; measurement and estimate are not used."""
        del sample, estimate
        last = len(self.setup.schedule) - 1
        inputs = self.setup.schedule[min(state.row, last)].copy()
        return ScheduleState(state.row + 1), Decision(inputs, Status.OK, "schedule")

    def decide_all(self, intervals: int) -> DecisionTable:
        """Inputs of the first intervals, at once."""
        last = len(self.setup.schedule) - 1
        return DecisionTable(self.setup.schedule[np.minimum(np.arange(intervals), last)], Status.OK, "schedule")
