"""The loop: plant, estimator and controller, one sampling interval after the other. Open loop is the same loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from adaptive_flot.protocols import (
    AnyController,
    AnyEstimator,
    AnyPlant,
    Decision,
    Estimate,
    PlantRecord,
    Prior,
    Sample,
)


@dataclass(frozen=True)
class Step:
    """Everything that one interval left behind; `estimate` is None until the estimator runs."""

    decision: Decision
    plant: PlantRecord
    estimate: Estimate | None


MakePrior = Callable[[list[Step]], Prior]


def run_loop(
    plant: AnyPlant,
    estimator: AnyEstimator,
    controller: AnyController,
    intervals: int,
    *,
    initial_intervals: int,
    make_prior: MakePrior,
) -> list[Step]:
    """Run the closed loop.

    Parameters
    ----------
    plant, estimator, controller
        The three contracts of `adaptive_flot.protocols`.
    intervals
        Number of sampling intervals N.
    initial_intervals
        Intervals before the estimator starts; their steps are handed to `make_prior`.
    make_prior
        Where the estimator starts, from the steps so far.

    Returns
    -------
    list of Step
        One an interval.
    """
    plant_state, controller_state = plant.init(), controller.init(0.0)
    estimator_state = None
    steps: list[Step] = []
    sample: Sample | None = None
    estimate: Estimate | None = None
    for k in range(intervals):
        controller_state, decision = controller.decide(controller_state, sample, estimate)
        plant_state, record = plant.apply(plant_state, decision.inputs)
        sample = record.sample
        if k >= initial_intervals:
            if estimator_state is None:
                estimator_state = estimator.init(make_prior(steps))
            estimator_state, estimate = estimator.update(estimator_state, sample)
        steps.append(Step(decision, record, estimate))
    return steps
