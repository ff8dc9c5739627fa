"""The loop: plant, estimator and controller, one sampling interval after the other. Open loop is the same loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from adaptive_flot.child_processes import heed_signals
from adaptive_flot.contracts import (
    AnyController,
    AnyEstimator,
    AnyPlant,
    Decision,
    Estimate,
    PlantRecord,
    Prior,
    Sample,
)
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.loop.returned import checked_decision, checked_estimate


@dataclass(frozen=True)
class Step:
    """Everything that one interval left behind; `estimate` is None until the estimator runs."""

    decision: Decision
    plant: PlantRecord
    estimate: Estimate | None


@dataclass(frozen=True)
class Running:
    """What estimates and decides, and where it stands after the last interval.

    Attributes
    ----------
    estimator, controller
        Who works.
    estimator_state, controller_state
        Their states; None before an estimator starts.
    estimate
        The newest estimate.
    prior
        Where the estimator started.
    further
        Values of the parameters that its model has beyond those that the plant's instruments know of (k,).
    """

    estimator: AnyEstimator
    controller: AnyController
    controller_state: Any
    estimator_state: Any = None
    estimate: Estimate | None = None
    prior: Prior | None = None
    further: FloatArray = field(default_factory=lambda: np.empty(0))

    def with_all_parameters(self, sample: Sample) -> Sample:
        """The sample with known parameters, where there are any, as the model in use has them."""
        if sample.parameters is None or not self.further.size:
            return sample
        return replace(sample, parameters=np.concatenate([sample.parameters, self.further]))

    def shown(self, sample: Sample) -> Sample:
        """The sample for the controller, with what the estimator found of disturbances that nobody measures."""
        every = self.with_all_parameters(sample)
        return every if self.estimate is None else self.estimate.shown_with(every, self.estimator.setup.model)

    def estimated(self, sample: Sample, make_prior: Callable[[], Prior]) -> Running:
        """One sample later; the first one starts the estimator."""
        now = self
        if now.prior is None:
            prior = make_prior()
            now = replace(now, prior=prior, estimator_state=now.estimator.init(prior))
        returned = now.estimator.update(now.estimator_state, now.with_all_parameters(sample))
        state, estimate = checked_estimate(now.estimator, returned)
        return replace(now, estimator_state=state, estimate=estimate)


MakePrior = Callable[[list[Step]], Prior]
Supervise = Callable[[Running, list[Step]], Running]


def unwatched(running: Running, steps: list[Step]) -> Running:
    """The loop as it is, whatever its steps show."""
    del steps
    return running


def run_loop(
    plant: AnyPlant,
    estimator: AnyEstimator,
    controller: AnyController,
    intervals: int,
    *,
    initial_intervals: int,
    make_prior: MakePrior,
    supervise: Supervise = unwatched,
) -> list[Step]:
    """Run the closed loop.

    Parameters
    ----------
    plant, estimator, controller
        The three contracts of `adaptive_flot.contracts`.
    intervals
        Number of sampling intervals N.
    initial_intervals
        Intervals before the estimator starts; their steps are handed to `make_prior`.
    make_prior
        Where the estimator starts, from the steps so far.
    supervise
        Looks at the steps after each interval and may change who estimates and decides.

    Returns
    -------
    list of Step
        One an interval.
    """
    plant_state, now = plant.init(), Running(estimator, controller, controller.init(0.0))
    inputs = len(estimator.setup.model.inputs)
    steps: list[Step] = []
    sample: Sample | None = None
    for k in range(intervals):
        shown = None if sample is None else now.shown(sample)
        returned = now.controller.decide(now.controller_state, shown, now.estimate)
        controller_state, decision = checked_decision(now.controller, returned, inputs)
        plant_state, record = plant.apply(plant_state, decision.inputs)
        sample, now = record.sample, replace(now, controller_state=controller_state)
        if k >= initial_intervals:
            now = now.estimated(sample, lambda: make_prior(steps))
        heed_signals()  # what an estimator or a controller calls may have lost one
        steps.append(Step(decision, record, now.estimate))
        now = supervise(now, steps)
    return steps
