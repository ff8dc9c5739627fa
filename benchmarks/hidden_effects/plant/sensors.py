"""What stands between an output and its measurement: sensor effects, noise, faults. Online, a row a second."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.cell.sites import OUTPUTS, SENSOR_OF
from benchmarks.hidden_effects.effects import curves
from benchmarks.hidden_effects.effects.spec import Spec

Row = Mapping[str, float]
OUTPUT_OF = {sensor: output for output, sensor in SENSOR_OF.items()}


class SensorEffect:
    """One effect at one sensor; keeps what its dynamics need between calls."""

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.output = OUTPUT_OF[spec.site]
        self._stages: list[float] = []
        self._past: deque[float] = deque()
        self._held, self._until = math.nan, -math.inf
        self._curve = None
        if spec.driver == "time":
            self._curve = curves.temporal(spec.shape, spec.parameters)
        elif spec.driver not in ("constant", "lag", "delay"):
            self._curve = spec.static_curve()

    def __call__(self, t: float, y: float, row: Row) -> float:
        """Measured value of the output y at time t [s]; row holds the drivers."""
        spec = self.spec
        match spec.shape:
            case "cascade":
                return self._lag(y) if spec.amplitude else y
            case "dead_time":
                return self._delay(y)
            case "multiplexed":
                return self._multiplex(t, y)
            case "gain":
                return y * (1.0 + spec.amplitude)
            case "bent":
                return y * (1.0 + spec.amplitude * y / spec.high)
        s = 1.0 if self._curve is None else self._curve(t if spec.driver == "time" else row[spec.driver])
        return y + spec.amplitude * spec.unit * (s - spec.centre)

    def _lag(self, y: float) -> float:
        """Two unequal lags in series, exact for an output that is straight within each second."""
        self._stages = self._stages or [y, y, y]
        old = self._stages.copy()
        self._stages[0] = y
        for k, tau in ((1, self.spec.amplitude), (2, 0.35 * self.spec.amplitude)):
            decay = math.exp(-1.0 / tau)
            held = tau * (1.0 - decay)
            slope = self._stages[k - 1] - old[k - 1]
            self._stages[k] = decay * old[k] + (1.0 - decay) * old[k - 1] + slope * (1.0 - held)
        return self._stages[2]

    def _delay(self, y: float) -> float:
        """Dead time that need not be a whole number of samples."""
        whole = int(self.spec.amplitude)
        part = self.spec.amplitude - whole
        self._past = self._past or deque([y] * (whole + 2), maxlen=whole + 2)
        self._past.append(y)
        return (1.0 - part) * self._past[1] + part * self._past[0]

    def _multiplex(self, t: float, y: float) -> float:
        """An analyser that visits this stream every `amplitude` seconds and holds its value between."""
        if t >= self._until:
            self._held, self._until = y, t + max(1.0, self.spec.amplitude)
        return self._held


@dataclass(frozen=True)
class Fault:
    """A fault of the data: `frozen`, `clipped` or `gap` of one output from `start` on for `seconds`."""

    kind: str
    output: str
    start: float
    seconds: float
    limit: float = 0.0

    def apply(self, values: Array) -> Array:
        """Faulty copy of the measured column (N,), row k at second k + 1."""
        first, last = int(self.start), int(min(len(values), self.start + self.seconds))
        faulty = values.copy()
        if self.kind == "clipped":
            faulty[first:last] = np.minimum(values[first:last], self.limit)
        else:
            faulty[first:last] = values[first] if self.kind == "frozen" else np.nan
        return faulty


class Instruments:
    """All sensors of a record: effects in order, then noise that was drawn beforehand."""

    def __init__(self, specs: Sequence[Spec], noise: Mapping[str, Array], proportional: Mapping[str, bool],
                 step: Mapping[str, float]) -> None:  # fmt: skip
        self._effects = [SensorEffect(s) for s in specs if not s.in_equations]
        self._noise, self._proportional, self._step = noise, proportional, step
        self.clean: list[list[float]] = []
        self.noisy: list[list[float]] = []

    def measure(self, t: float, row: Row) -> list[float]:
        """Measured outputs, in the order of `OUTPUTS`, of one row; the noise is that of the number of rows so far."""
        k = len(self.clean)
        clean, noisy = [], []
        for name in OUTPUTS:
            y = row[name]
            for effect in self._effects:
                if effect.output == name:
                    y = effect(t, y, row)
            clean.append(y)
            e = float(self._noise[name][k])
            value = y * (1.0 + e) if self._proportional[name] else y + e
            if self._step[name]:
                value = round(value / self._step[name]) * self._step[name]
            noisy.append(value)
        self.clean.append(clean)
        self.noisy.append(noisy)
        return noisy
