"""Plants: a simulated one with noise and drifting parameters, and a measured record that is replayed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adaptive_flot.contracts import DelayedValue, PlantRecord, Sample
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.plants.true_outputs import TrueOutputs
from adaptive_flot.runner.scenario.disturbances import Disturbances


@dataclass(frozen=True)
class SimulatedState:
    """Interval to come, the true state (nx,) at its start, and what was measured and is not known yet."""

    row: int
    x: FloatArray
    pending: tuple[DelayedValue, ...] = ()


class SimulatedPlant:
    """The model with its own parameters and measurement noise, both given for every interval.

    Parameters
    ----------
    model
        The plant's model.
    dt
        Sampling interval [s].
    x0
        True state at time 0 (nx,).
    parameters
        True parameters in each interval (N, np).
    noise
        Noise added to each output (N, ny); NaN where an output is not measured.
    disturbances
        Inputs that the plant imposes whatever is applied, and what is known of them; default none.
    accurate
        Integrate with IDAS.
    dead_time
        Time from taking a measurement to knowing it, by output name [s].
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        x0: FloatArray,
        parameters: FloatArray,
        noise: FloatArray,
        *,
        disturbances: Disturbances | None = None,
        accurate: bool = False,
        dead_time: Mapping[str, float] | None = None,
    ) -> None:
        self._delayed = {model.index("outputs", name): (name, d) for name, d in (dead_time or {}).items() if d > 0}
        self._dt = dt
        self._x0 = x0
        self._parameters = parameters
        self._noise = noise
        self._disturbances = disturbances
        self._step = Stepper(model, dt, accurate=accurate).call
        self._true = TrueOutputs(model)

    def init(self) -> SimulatedState:
        """Start at the initial state."""
        return SimulatedState(0, self._x0.copy())

    def apply(self, state: SimulatedState, inputs: FloatArray) -> tuple[SimulatedState, PlantRecord]:
        """Hold the inputs for one interval; see `Plant.apply`."""
        k = state.row
        acting, shown, known_parameters = self._around(k, inputs)
        p = self._parameters[k]
        x, y, _ = self._step(state.x, k * self._dt, acting, p)
        now, measured = (k + 1) * self._dt, y + self._noise[k]
        taken = tuple(DelayedValue(name, now, float(measured[j])) for j, (name, _) in self._delayed.items())
        measured[list(self._delayed)] = np.nan
        known, pending = self._arrived((*state.pending, *taken), now)
        sample = Sample(now, shown, measured, known, known_parameters)
        true = self._true(y, now, x, acting, p)
        return SimulatedState(k + 1, x, pending), PlantRecord(sample, true, p, acting)

    def _around(self, row: int, inputs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Inputs that act, inputs that are known, and known parameters."""
        if self._disturbances is None:
            return inputs, inputs, None
        imposed, shown, known = self._disturbances.inputs[row], self._disturbances.shown[row], None
        if self._disturbances.parameters is not None:
            known = self._disturbances.parameters[row]
        return np.where(np.isnan(imposed), inputs, imposed), np.where(np.isnan(shown), inputs, shown), known

    def _arrived(
        self, values: tuple[DelayedValue, ...], now: float
    ) -> tuple[tuple[DelayedValue, ...], tuple[DelayedValue, ...]]:
        """Cut the values into those known by now and those still to come; a value that is NaN never was."""
        wait = dict(self._delayed.values())
        due = [v.time + wait[v.output] <= now + 1e-9 for v in values]
        known = tuple(v for v, d in zip(values, due, strict=True) if d)
        return known, tuple(v for v, d in zip(values, due, strict=True) if not d and np.isfinite(v.value))


@dataclass(frozen=True)
class ReplayState:
    """Row of the record to show next."""

    row: int


class ReplayPlant:
    """A measured record as a plant: it shows its rows 1, 2, ... whatever the inputs are; truth is unknown (NaN)."""

    def __init__(self, record: Dataset, parameter_count: int) -> None:
        self.record = record
        self._unknown = np.full(parameter_count, np.nan)

    def init(self) -> ReplayState:
        """Start at row 0, the initial instant."""
        return ReplayState(1)

    def apply(self, state: ReplayState, inputs: FloatArray) -> tuple[ReplayState, PlantRecord]:
        """Show the next row; the inputs are those of the record."""
        del inputs
        k = state.row
        sample = Sample(float(self.record.time[k]), self.record.inputs[k], self.record.outputs[k])
        unknown = np.full(len(sample.outputs), np.nan)
        return ReplayState(k + 1), PlantRecord(sample, unknown, self._unknown, sample.inputs)
