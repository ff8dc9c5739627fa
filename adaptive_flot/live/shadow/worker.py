"""What runs in the process of a shadow: estimator and controller on the samples that it is sent.

It has no client and no address of a plant. What it decides goes back to the link, which stores and shows it.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot.contracts import Decision, Estimate, Prior, Sample, TracksInputs
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.live.link.children import beside_the_cycle
from adaptive_flot.live.link.estimation import Estimation, EstimationState
from adaptive_flot.live.link_file import Link, load_link
from adaptive_flot.live.store.beside import ShadowResult
from adaptive_flot.runner.adaptation.bumpless_transfer import states_at_rest
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.returned import checked_decision
from adaptive_flot.runner.scenario.realisation import Realisation


@dataclass(frozen=True)
class ShadowPlan:
    """What runs in shadow.

    Attributes
    ----------
    role
        Its name in database and page.
    estimator, controller
        Their names in the scenario; no controller: nothing is decided.
    effects
        What its model has beyond the scenario's.
    parameters
        Values of adapted parameters, by full name, that were fitted with the effects.
    history
        State that was fitted with them (nx,), its time [s], and the inputs of the intervals since (rows, nu); None
        where the record does not reach back so far: the acting estimator's state is carried over then.
    """

    role: str
    estimator: str
    controller: str | None = None
    effects: tuple[Effect, ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    history: tuple[FloatArray, float, FloatArray] | None = None


@dataclass(frozen=True)
class Task:
    """One sample for a shadow: number of its cycle, the inputs that act (nu,), and where the acting estimator stands.

    Attributes
    ----------
    start
        Where the acting estimator stands after the sample.
    """

    cycle: int
    sample: Sample
    acting: FloatArray
    start: Prior


class ShadowStepper:
    """An estimator, and maybe a controller, of a link's scenario; its first task starts it.

    Parameters
    ----------
    link
        The link file and its scenario.
    plan
        What runs.
    """

    def __init__(self, link: Link, plan: ShadowPlan) -> None:
        scenario = link.scenario
        prepared = Prepared.of(scenario, [plan.estimator], [plan.controller or link.file.controller])
        realisation = Realisation(scenario, scenario.file.seeds[0])
        setup = scenario.setup
        if plan.effects:
            setup = replace(setup, model=scenario.model.with_effects(plan.effects))
        self.plan, self._setup, self._base = plan, setup, scenario.model
        self._nominal = scenario.file.estimators[plan.estimator].start == "nominal"
        estimator = prepared.new_estimator(plan.estimator, setup)
        self._estimation = Estimation(prepared, estimator, "initial_estimate", link.file.cycle.longest_gap_s)
        self._controller = None if plan.controller is None else prepared.controller(plan.controller, realisation, setup)
        self._state: EstimationState | None = None
        self._control: Any = None
        self._further = setup.model.parameter_values[len(scenario.model.parameters) :]

    def step(self, task: Task) -> ShadowResult:
        """Take a sample; the first one only says where to start."""
        begin = time.perf_counter()
        if self._state is None:
            began = self._prior(task)
            inner = self._estimation.estimator.init(began)
            self._state = EstimationState(inner=inner, began=began, last=self._known(task.sample))
            self._control = None if self._controller is None else self._controller.init(task.sample.time)
            return ShadowResult(task.cycle, self.plan.role, "started", time.perf_counter() - begin)
        sample = self._known(task.sample)
        self._state = self._estimation.take(self._state, sample)
        estimate = self._state.estimate
        decision = None if estimate is None else self._decided(sample, estimate, task.acting)
        words = "no estimate" if estimate is None else estimate.status.value
        if decision is not None and decision.status.value != "ok":
            words = f"{words}; controller: {decision.status.value}"
        return ShadowResult(task.cycle, self.plan.role, words, time.perf_counter() - begin, estimate, decision)

    def _known(self, sample: Sample) -> Sample:
        if sample.parameters is None or not self._further.size:
            return sample
        return replace(sample, parameters=np.concatenate([sample.parameters, self._further]))

    def _prior(self, task: Task) -> Prior:
        """Where the acting estimator stands, in this one's model: states of effects at rest."""
        start, setup = task.start, self._setup
        own = len(self._base.states)
        values, state = start.parameters.copy(), start.state[:own]
        for name, value in self.plan.parameters:
            values[setup.parameters.index(name)] = value
        if self._nominal:
            values = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
        if self.plan.history is not None:
            state = self._run_on(*self.plan.history, values, task.sample.time)
        elif len(setup.model.states) > own:
            full = setup.model.parameter_values
            full[setup.model.indices("parameters", setup.parameters)] = values
            rest = states_at_rest(setup.model, state, task.sample.inputs, full, task.sample.time)
            state = np.concatenate([state, rest])
        colour = None if self.plan.effects else start.colour  # what they explain, the errors do not show any more
        return replace(start, time=task.sample.time, state=state, parameters=values, colour=colour)

    def _run_on(
        self, fitted: FloatArray, begin: float, inputs: FloatArray, values: FloatArray, now: float
    ) -> FloatArray:
        """State now of the free run from the fitted one: what the model lacked has put the acting one's state off."""
        setup = self._setup
        rows = max(1, round((now - begin) / setup.dt))
        played = np.vstack([inputs, np.repeat(inputs[-1:], max(0, rows - len(inputs)), axis=0)])[:rows]
        full = setup.model.parameter_values
        full[setup.model.indices("parameters", setup.parameters)] = values
        return np.asarray(Stepper(setup.model, setup.dt).simulate(fitted, played, full, begin).states[-1])

    def _decided(self, sample: Sample, estimate: Estimate, acting: FloatArray) -> Decision | None:
        if self._controller is None:
            return None
        if isinstance(self._controller, TracksInputs):
            self._control = self._controller.tracked(self._control, acting)
        shown = estimate.shown_with(sample, self._setup.model)
        returned = self._controller.decide(self._control, shown, estimate)
        self._control, decision = checked_decision(self._controller, returned, len(sample.inputs))
        return decision


Make = Callable[[Path, ShadowPlan], ShadowStepper]


def make_stepper(link_file: Path, plan: ShadowPlan) -> ShadowStepper:
    """The stepper of a plan."""
    return ShadowStepper(load_link(link_file), plan)


def work(connection: Connection, link_file: Path, plan: ShadowPlan, make: Make) -> None:
    """Main function of the process: it ends with the link, or with the first error, which it tells."""
    link = multiprocessing.parent_process()
    if link is not None and link.pid is not None:
        beside_the_cycle(link.pid)
    try:
        stepper = make(link_file, plan)
        connection.send(None)  # built: it can start where the acting estimator stands now
        while True:
            connection.send(stepper.step(connection.recv()))
    except EOFError:
        return
    except Exception as error:
        connection.send(f"{type(error).__name__}: {error}")
