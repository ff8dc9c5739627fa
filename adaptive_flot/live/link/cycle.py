"""One cycle of the link: check, estimate, decide, mode, limits.

A cycle is a function of the state and of what the plant told. It reads no clock and writes nothing, so that any stored
hour can be replayed to the bit, and a test can try any sequence of events.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyController, Decision, Estimate, Prior, Sample, Status, TracksInputs
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.link.estimation import Estimation, EstimationState
from adaptive_flot.live.link.samples import Histories, Reading, Samples, forgotten
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.modes import CycleFacts, Mode, ModeState, step
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.returned import checked_decision
from adaptive_flot.runner.scenario.realisation import Realisation

NO_SOLUTION = (Status.HELD, Status.SAFE_INPUT)
"""Decisions that nobody has found: they are not written."""


@dataclass(frozen=True)
class CycleState:
    """What the next cycle needs.

    Attributes
    ----------
    number
        Cycles so far.
    epoch
        Plant's time at which the record's time is 0 [s]; None before the first sample.
    modes
        State of the mode machine.
    histories
        What the checks of values need.
    estimation, controller
        States of estimator and controller; the latter is None before the first sample.
    on_target
        The controller's last decision is being written: what acts is on its way there.
    sample
        The newest sample.
    """

    number: int = 0
    epoch: float | None = None
    modes: ModeState = field(default_factory=ModeState)
    histories: Histories = field(default_factory=Histories)
    estimation: EstimationState = field(default_factory=EstimationState)
    controller: Any = None
    on_target: bool = False
    sample: Sample | None = None


@dataclass(frozen=True)
class _Asked:
    """A decision, and the set-points towards it that the limits allow; empty where they allow none."""

    controller: Any
    decision: Decision | None = None
    moves: Mapping[str, float] = field(default_factory=dict)
    found: bool = False
    problem: str = ""


class Cycle:
    """The cycles of a link, with the estimator and the controller of its scenario.

    Parameters
    ----------
    link
        The link file and its scenario.
    effects
        What the model in use has beyond the scenario's.

    Raises
    ------
    AdaptiveFlotError
        The plug-ins do not take the extended model.
    """

    def __init__(self, link: Link, effects: tuple[Effect, ...] = ()) -> None:
        file, scenario = link.file, link.scenario
        prepared = Prepared.of(scenario, [file.estimator], [file.controller])
        realisation = Realisation(scenario, scenario.file.seeds[0])
        self.link, self.effects = link, effects
        estimator = prepared.estimator(file.estimator, realisation)
        if effects:
            extended = replace(scenario.setup, model=scenario.model.with_effects(effects))
            estimator = prepared.new_estimator(file.estimator, extended)
        start = prepared.estimators[file.estimator].start
        self.estimation = Estimation(prepared, estimator, start, file.cycle.longest_gap_s)
        self.controller: AnyController = prepared.controller(file.controller, realisation, estimator.setup)
        self.model = estimator.setup.model
        self._further = self.model.parameter_values[len(scenario.model.parameters) :]
        self.limits = {name: write.limit for name, write in file.writes.items()}
        self._samples = Samples(link)
        self._rules = file.mode_rules
        self._dt = scenario.dt
        self._moved = {name: scenario.model.index("inputs", name) for name in file.writes}

    def start(self, resumes: Prior | None = None) -> CycleState:
        """In monitor and not armed, whatever was before; a stored estimate is where the estimator goes on."""
        return CycleState(estimation=EstimationState(resumes=resumes))

    def go_on(self, state: CycleState, prior: Prior) -> CycleState:
        """Where a cycle with another model stood: the estimator starts anew, the controller from what acts."""
        inner = self.estimation.estimator.init(prior)
        estimation = EstimationState(inner=inner, began=prior, last=state.sample)
        controller = None if state.sample is None else self.controller.init(state.sample.time)
        return replace(state, estimation=estimation, controller=controller, on_target=False)

    def step(self, state: CycleState, snapshot: Snapshot) -> tuple[CycleState, Outcome]:
        """One cycle."""
        state = replace(state, number=state.number + 1)
        state, time = self._time(state, snapshot)
        reading, estimate, problem = None, None, ""
        if time is not None and state.modes.mode is not Mode.OFF:
            histories, reading = self._samples.read(state.histories, snapshot, time, state.sample)
            state = replace(state, histories=histories, sample=reading.sample or state.sample)
            if reading.sample is not None:
                state, estimate, problem = self._estimated(state, reading.sample)
        asked = self._asked(state, snapshot, reading, estimate)
        facts = CycleFacts(
            switch=snapshot.permitted(state.modes.mode),
            alive=time is not None,
            measured=(reading is not None and reading.good) or state.modes.mode is Mode.OFF,
            solved=asked.found or state.modes.mode not in (Mode.ADVISORY, Mode.CLOSED),
            in_time=snapshot.in_time,
            written=snapshot.written,
            granted=snapshot.granted,
        )
        moved = step(self._rules, state.modes, facts)
        writes = dict(asked.moves) if moved.may_write else {}
        acting = {} if reading is None else reading.acting
        outcome = Outcome(
            state.number,
            moved.state.mode,
            moved.reason,
            (*facts.faults(), *(words for words in (problem, asked.problem) if words)),
            {} if reading is None else reading.checks,
            None if reading is None else reading.sample,
            estimate,
            asked.decision,
            {name: value for name, value in writes.items() if value != acting[name]},
            acting,
            moved.asks_control,
        )
        return replace(state, modes=moved.state, controller=asked.controller, on_target=moved.may_write), outcome

    def _time(self, state: CycleState, snapshot: Snapshot) -> tuple[CycleState, float | None]:
        """Time of the sample on the grid of the record [s]; None where there is no new sample."""
        if not snapshot.alive or not math.isfinite(snapshot.time):
            return state, None
        last = None if state.estimation.last is None and state.sample is None else state.sample
        if state.epoch is None or last is None:
            return replace(state, epoch=snapshot.time - self._dt), self._dt
        time = round((snapshot.time - state.epoch) / self._dt) * self._dt
        if time > last.time + self._dt / 2:
            return state, time
        if time > last.time - self._dt / 2:
            return state, None
        # the plant's clock went back: its next sample follows the last one
        return replace(state, epoch=snapshot.time - last.time, histories=forgotten(state.histories)), None

    def _estimated(self, state: CycleState, sample: Sample) -> tuple[CycleState, Estimate | None, str]:
        try:
            after = self.estimation.take(state.estimation, self._known(sample))
        except Exception as error:  # a failed estimator must not take the link's mode machine with it
            return state, None, f"estimator: {type(error).__name__}: {error}"
        estimate = after.estimate
        if estimate is not None and not (np.isfinite(estimate.state).all() and np.isfinite(estimate.parameters).all()):
            return replace(state, estimation=after), None, "estimator: the estimate is not finite"
        controller = self.controller.init(sample.time) if state.controller is None else state.controller
        return replace(state, estimation=after, controller=controller), estimate, ""

    def _asked(
        self, state: CycleState, snapshot: Snapshot, reading: Reading | None, estimate: Estimate | None
    ) -> _Asked:
        """What the controller decides, in advisory and closed, and how far the limits let it go."""
        if reading is None or reading.sample is None or estimate is None or not reading.good:
            return _Asked(state.controller)
        if state.modes.mode not in (Mode.ADVISORY, Mode.CLOSED):
            return _Asked(self._tracked(state.controller, self._acting(reading)))
        before = state.controller if state.on_target else self._tracked(state.controller, self._acting(reading))
        try:
            shown = estimate.shown_with(self._known(reading.sample), self.model)
            returned = self.controller.decide(before, shown, estimate)
            after, decision = checked_decision(self.controller, returned, len(reading.sample.inputs))
        except Exception as error:  # a failed controller makes a bad cycle, and sheds if it goes on
            return _Asked(before, problem=f"controller: {type(error).__name__}: {error}")
        if decision.status in NO_SOLUTION:
            return _Asked(after, decision, problem=f"controller: {decision.status.value}")
        clamped, moves = decision.inputs.copy(), {}
        for name, j in self._moved.items():
            limit = self.limits[name].within(*snapshot.operator.get(name, (math.nan, math.nan)))
            value = limit.towards(float(decision.inputs[j]), reading.acting[name])
            if value is None:
                return _Asked(after, decision, problem=f"{name}: no value inside the limits can be reached from here")
            clamped[j], moves[name] = min(max(decision.inputs[j], limit.low), limit.high), value
        if not np.array_equal(clamped, decision.inputs):
            after = self._tracked(after, clamped)
        return _Asked(after, decision, moves, found=True)

    def _known(self, sample: Sample) -> Sample:
        """The sample with its measured parameters as the model in use has them."""
        if sample.parameters is None or not self._further.size:
            return sample
        return replace(sample, parameters=np.concatenate([sample.parameters, self._further]))

    def _acting(self, reading: Reading) -> np.ndarray[Any, np.dtype[np.float64]]:
        assert reading.sample is not None
        inputs = reading.sample.inputs.copy()
        for name, j in self._moved.items():
            inputs[j] = reading.acting[name]
        return inputs

    def _tracked(self, controller: Any, inputs: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
        """The controller's state, told what really acts."""
        return self.controller.tracked(controller, inputs) if isinstance(self.controller, TracksInputs) else controller
