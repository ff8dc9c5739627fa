"""A plant whose instruments and actuators fail as a scenario says, within the contract of a plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyPlant, DelayedValue, PlantRecord, Sample
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.scenario.faults import Frozen, PlantFault, SensorFault, SlowAnalyser, Stuck


@dataclass(frozen=True)
class FaultyState:
    """What the next interval needs.

    Attributes
    ----------
    inner
        State of the plant itself.
    row
        Interval to come.
    acted
        Inputs (nu,) that acted in the last interval; NaN before the first.
    shown
        Last value (ny,) that each output showed while no instrument was frozen; NaN before the first.
    pending
        Values taken by slow analysers that are not known yet, with the time at which they will be [s].
    """

    inner: Any
    row: int
    acted: FloatArray
    shown: FloatArray
    pending: tuple[tuple[float, DelayedValue], ...] = ()


class FaultyPlant:
    """A plant whose instruments and actuators fail as told; what fails in an interval is in `PlantRecord.faults`.

    Parameters
    ----------
    plant
        The plant.
    faults
        Faults in the order in which they act.
    model
        Names of inputs and outputs.
    dt
        Sampling interval [s].
    draws
        Uniform random numbers in [0, 1) for each interval and fault (N, number of faults, 2).
    """

    def __init__(
        self, plant: AnyPlant, faults: Sequence[PlantFault], model: Model, dt: float, draws: FloatArray
    ) -> None:
        self._plant = plant
        self._faults = tuple(enumerate(faults))
        self._model = model
        self._dt = dt
        self._draws = draws
        self._names = model.names("outputs")

    def init(self) -> FaultyState:
        """State at the start."""
        acted, shown = (np.full(len(q), np.nan) for q in (self._model.inputs, self._model.outputs))
        return FaultyState(self._plant.init(), 0, acted, shown)

    def apply(self, state: FaultyState, inputs: FloatArray) -> tuple[FaultyState, PlantRecord]:
        """Hold the inputs for one interval, as far as the actuators follow; see `Plant.apply`."""
        acting, hidden, failed = self._actuators(state, inputs)
        inner, record = self._plant.apply(state.inner, acting)
        sample = record.sample
        if hidden:  # no instrument shows what a stuck actuator does: the command is believed
            known = sample.inputs.copy()
            known[hidden] = inputs[hidden]
            sample = replace(sample, inputs=known)
        sample, broken = self._sensors(state, sample)
        sample, pending, slow = self._analysers(state, sample)
        after = FaultyState(inner, state.row + 1, record.inputs, self._shown(state, sample), pending)
        return after, replace(record, sample=sample, faults=(*failed, *broken, *slow))

    def _acting(self, time: float) -> list[tuple[int, PlantFault]]:
        return [(i, fault) for i, fault in self._faults if fault.acts(time)]

    def _actuators(self, state: FaultyState, inputs: FloatArray) -> tuple[FloatArray, list[int], list[str]]:
        """Inputs that act, those among them that no instrument shows, and names of the faults."""
        acting, hidden, names = inputs.copy(), [], []
        for _, fault in self._acting(state.row * self._dt):
            if isinstance(fault, Stuck):
                j = [q.column for q in self._model.inputs].index(fault.input)
                if np.isfinite(state.acted[j]):
                    acting[j] = state.acted[j]
                if not fault.measured:
                    hidden.append(j)
                names.append(f"stuck {self._model.inputs[j].name}")
        return acting, hidden, names

    def _sensors(self, state: FaultyState, sample: Sample) -> tuple[Sample, list[str]]:
        """The sample as the instruments show it, delayed values too, and names of the faults that changed a value."""
        outputs, delayed, names = sample.outputs.copy(), list(sample.delayed), []
        for i, fault in self._faults:
            if not isinstance(fault, SensorFault):
                continue
            j = self._model.index("outputs", fault.output)
            before = (outputs[j], *(v.value for v in delayed))
            if fault.acts(sample.time) and np.isfinite(outputs[j]):
                outputs[j] = fault.alter(outputs[j], state.shown[j], self._draw(sample.time, i))
            delayed = [
                replace(v, value=fault.alter(v.value, state.shown[j], self._draw(v.time, i)))
                if v.output == fault.output and fault.acts(v.time)
                else v
                for v in delayed
            ]
            if not np.array_equal(before, (outputs[j], *(v.value for v in delayed)), equal_nan=True):
                names.append(f"{fault.fault} {fault.output}")
        known = tuple(v for v in delayed if np.isfinite(v.value))
        return replace(sample, outputs=outputs, delayed=known), names

    def _shown(self, state: FaultyState, sample: Sample) -> FloatArray:
        """Last value of each output, for the day its instrument freezes: while it is frozen, that from before."""
        frozen = [f.output for _, f in self._acting(sample.time) if isinstance(f, Frozen)]
        newest = [*zip(self._names, sample.outputs, strict=True), *((v.output, v.value) for v in sample.delayed)]
        shown = state.shown.copy()
        for name, value in newest:
            if name not in frozen and np.isfinite(value):
                shown[self._names.index(name)] = value
        return shown

    def _draw(self, time: float, fault: int) -> tuple[float, float]:
        first, second = self._draws[round(time / self._dt) - 1, fault]
        return float(first), float(second)

    def _analysers(
        self, state: FaultyState, sample: Sample
    ) -> tuple[Sample, tuple[tuple[float, DelayedValue], ...], list[str]]:
        """The sample without what a slow analyser has not measured or not told yet."""
        outputs, names, now = sample.outputs.copy(), [], sample.time
        pending = list(state.pending)
        for _, fault in self._acting(now):
            if not isinstance(fault, SlowAnalyser):
                continue
            j = self._model.index("outputs", fault.output)
            taken = (now - fault.from_s) % fault.every_s < self._dt - 1e-9
            if np.isfinite(outputs[j]) and not (taken and fault.dead_time_s == 0):
                if taken:
                    pending.append((now + fault.dead_time_s, DelayedValue(fault.output, now, float(outputs[j]))))
                outputs[j] = np.nan
                names.append(f"{fault.fault} {fault.output}")
        due = tuple(value for known_at, value in pending if known_at <= now + 1e-9)
        later = tuple((known_at, value) for known_at, value in pending if known_at > now + 1e-9)
        return replace(sample, outputs=outputs, delayed=(*sample.delayed, *due)), later, names
