"""A disturbance that nobody measures: the controller is shown what the estimator found of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import Decision, Estimate, Prior, Sample, Status
from adaptive_flot.runner.loop.loop import run_loop
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.plants.scenario_plant import make_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation

GRADE = "feed_concentration.chalcopyrite"


class Finds:
    """An estimator that finds the feed grade to be twelve."""

    def __init__(self, inner: Any) -> None:
        self.inner, self.setup = inner, inner.setup

    def init(self, prior: Any) -> Any:
        return self.inner.init(prior)

    def update(self, state: Any, sample: Sample) -> tuple[Any, Estimate]:
        after, estimate = self.inner.update(state, sample)
        return after, replace(estimate, disturbances={GRADE: 12.0})


class Notes:
    """A controller that holds the inputs and notes the feed grade that it is shown."""

    def __init__(self, inputs: np.ndarray[Any, np.dtype[np.float64]], column: int) -> None:
        self.inputs, self.column, self.seen = inputs, column, list[float | None]()

    def init(self, time: float) -> None:
        del time

    def decide(self, state: None, sample: Sample | None, estimate: Estimate | None) -> tuple[None, Decision]:
        del estimate
        known = None if sample is None or sample.parameters is None else float(sample.parameters[self.column])
        self.seen.append(known)
        return None, Decision(self.inputs, Status.OK, "notes")


def test_the_controller_is_shown_what_the_estimator_found() -> None:
    scenario = load_scenario("feed_disturbance_unmeasured")
    realisation = Realisation(scenario, 1)
    prepared = Prepared.of(scenario, ["fixed"])
    estimator = Finds(prepared.estimator("fixed", realisation))
    nominal = scenario.model.parameter_values
    column = scenario.model.index("parameters", GRADE)
    controller = Notes(realisation.plan[0], column)

    known = nominal[scenario.model.indices("parameters", scenario.setup.parameters)]
    start = Prior(4.0, np.zeros(len(scenario.model.states)), known, np.eye(2), np.array([1e-3]))
    plant = make_plant(realisation, scenario.model)
    run_loop(plant, estimator, controller, 6, initial_intervals=3, make_prior=lambda steps: start)
    assert controller.seen == [None] * 4 + [12.0] * 2
