"""How soon a plant can be back above the limit of the grade at all: the bound of every controller."""

from __future__ import annotations

from typing import Any

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Decision, Estimate, Sample, Status
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.state import MpcState


class Fastest:
    """The economic MPC up to a time; from then on every input goes down by its largest move with each move.

    Less air and a lower level give a higher grade. No value counts any more, so this is no controller to use.

    Parameters
    ----------
    setup
        Of the controller.
    from_s
        Time of the first of these moves [s]; default the first decision.
    options
        Of the economic MPC before that.
    """

    def __init__(self, setup: ControllerSetup, *, from_s: float = 0.0, **options: Any) -> None:
        self.before, self.from_s = EconomicMpc(setup, **options), from_s
        limits, layout = setup.limits, self.before.layout
        assert limits is not None
        self._lowest = np.array([limits.inputs[name][0] for name in layout.moved_names])
        self._largest = np.array([limits.moves[name] for name in layout.moved_names])
        self._moved, self._move_s = layout.moved, layout.move_s

    def init(self, time: float) -> tuple[MpcState, float]:
        """Nothing was moved yet."""
        return self.before.init(time), self.from_s

    def decide(
        self, state: tuple[MpcState, float], sample: Sample | None, estimate: Estimate | None
    ) -> tuple[tuple[MpcState, float], Decision]:
        """What the economic MPC does, or the next move down."""
        inner, due = state
        if sample is None or estimate is None or sample.time < self.from_s:
            inner, decision = self.before.decide(inner, sample, estimate)
            return (inner, due), decision
        inputs = sample.inputs.copy()
        if sample.time >= due:
            due = max(due, sample.time) + self._move_s
            inputs[self._moved] = np.maximum(inputs[self._moved] - self._largest, self._lowest)
        return (inner, due), Decision(inputs, Status.OK, "fastest")
