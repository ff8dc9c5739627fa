"""A controller that gets into the trouble that a scenario asks for, and has to get out of it by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from adaptive_flot.contracts import AnyController, Decision, Estimate, Sample, TakesOver
from adaptive_flot.runner.scenario.faults import ControllerFault, NanState


@runtime_checkable
class Optimising(Protocol):
    """A controller with a solver that can be made to fail."""

    def with_failing_solver(self) -> AnyController:
        """The same controller, states included, whose optimisations find nothing."""
        ...


class FaultyController:
    """A controller whose solver fails, or whose state estimate is no number, as told; the states are its own.

    Parameters
    ----------
    controller
        The controller; one without `with_failing_solver` has no solver to fail.
    faults
        The faults.
    """

    def __init__(self, controller: AnyController, faults: Sequence[ControllerFault]) -> None:
        self._controller = controller
        self._faults = faults
        self._failing = controller.with_failing_solver() if isinstance(controller, Optimising) else None

    def init(self, time: float) -> Any:
        """State before the first decision."""
        return self._controller.init(time)

    def take_over(self, before: AnyController, state: Any, known: Sequence[Estimate], again: Sequence[Estimate]) -> Any:
        """Go on where another stood; see `TakesOver.take_over`."""
        inner = before._controller if isinstance(before, FaultyController) else before
        if isinstance(self._controller, TakesOver):
            return self._controller.take_over(inner, state, known, again)
        return state

    def decide(self, state: Any, sample: Sample | None, estimate: Estimate | None) -> tuple[Any, Decision]:
        """Decide with what the faults leave; see `Controller.decide`."""
        names: list[str] = []
        controller = self._controller
        if sample is None or estimate is None:
            return controller.decide(state, sample, estimate)
        for fault in self._faults:
            if not fault.acts(sample.time):
                continue
            if isinstance(fault, NanState):
                estimate = replace(estimate, state=np.full_like(estimate.state, np.nan))
                names.append(fault.fault)
            elif self._failing is not None:
                controller = self._failing
        state, decision = controller.decide(state, sample, estimate)
        if controller is self._failing and np.isfinite(decision.solve_seconds):
            names.append("solver_failure")
        return state, replace(decision, faults=tuple(names))
