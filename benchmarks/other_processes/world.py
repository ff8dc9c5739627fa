"""One plant in one record: what it draws from, and how it is integrated. No code of the package is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
Columns = dict[str, Array]
Rate = Callable[[int, tuple[float, ...]], tuple[float, ...]]


@dataclass(frozen=True)
class World:
    """A record to be made of a plant.

    Attributes
    ----------
    rows, dt
        Rows, and seconds between them.
    case
        What is the matter, see `Process.cases`.
    rich
        1 for a plant that is richer than its model, 0 for one that is just its model.
    feedback
        Whether a controller moves the input, where the plant has one.
    plant, record, fault
        Draws of the plant (those of its reference record too), of this record, and of what is the matter.
    """

    rows: int
    dt: float
    case: str
    rich: float
    feedback: bool
    plant: Rng
    record: Rng
    fault: Rng

    def off(self, value: float, share: float = 0.1) -> float:
        """Draw a constant of the plant that is slightly off its usual value."""
        return value * float(np.exp(self.rich * share * self.plant.standard_normal()))

    def extra(self, low: float, high: float) -> float:
        """Draw a constant of what the model does not have; 0 where the plant is just its model."""
        return self.rich * float(self.plant.uniform(low, high))

    def hold(self, levels: Sequence[float], shortest: int, longest: int) -> Array:
        """Draw an input that stays for so many rows at a level: any between two, or one of several."""
        values: list[float] = []
        while len(values) < self.rows:
            level = (
                self.record.uniform(levels[0], levels[1]) if len(levels) == 2 else self.record.choice(np.array(levels))
            )
            values += [float(level)] * int(self.record.integers(shortest, longest + 1))
        return np.array(values[: self.rows])

    def weather(self, middle: float, swing: float, memory_s: float, wander: float) -> Array:
        """Draw a measured disturbance: a day's swing and a slow course. It is there however rich the plant is."""
        t = self.dt * np.arange(self.rows)
        phase = self.record.uniform(0, 2 * np.pi)
        return middle + swing * np.sin(2 * np.pi * t / 86_400 + phase) + wander * self._course(memory_s)

    def wander(self, memory_s: float, std: float) -> Array:
        """Draw an unmeasured disturbance of a standard deviation; nothing where the plant is just its model."""
        return self.rich * std * self._course(memory_s)

    def episodes(self, count: tuple[int, int], length: tuple[int, int]) -> Array:
        """Draw when something is switched: 1 in the rows in which it is on (rows,), apart from one another."""
        on = np.zeros(self.rows)
        number = int(self.fault.integers(count[0], count[1] + 1))
        ends = np.linspace(0.08 * self.rows, 0.95 * self.rows, number + 1).astype(int)
        for a, b in pairwise(ends):
            long = min(int(self.fault.integers(length[0], length[1] + 1)), (b - a) // 2)
            first = int(self.fault.integers(a, b - long - 3))
            on[first : first + long] = 1.0
        return on

    def onset(self) -> int:
        """Draw the row in which something begins to be the matter."""
        return int(self.rows * self.fault.uniform(0.3, 0.7))

    def _course(self, memory_s: float) -> Array:
        """First-order autoregressive course of standard deviation 1 (rows,)."""
        a = float(np.exp(-self.dt / memory_s))
        e = self.record.standard_normal(self.rows)
        x = np.empty(self.rows)
        x[0] = e[0]
        for k in range(1, self.rows):
            x[k] = a * x[k - 1] + np.sqrt(1 - a * a) * e[k]
        return x


def integrate(
    rate: Rate,
    start: Sequence[float],
    world: World,
    fine: int,
    *,
    kicks: Array | None = None,
    before: Callable[[int, tuple[float, ...]], None] | None = None,
) -> Array:
    """States at every row (rows, n), by steps of Euler.

    Parameters
    ----------
    rate
        Derivatives in the interval that leads to row k, `rate(k, x)`.
    start
        States in the first row (n,).
    world
        Rows and interval.
    fine
        Steps an interval.
    kicks
        Process noise: what is added to the states in each row (rows, n).
    before
        Called before each interval with the row that it leads to and the states: a controller.
    """
    x, h = tuple(map(float, start)), world.dt / fine
    found = np.empty((world.rows, len(x)))
    found[0] = x
    for k in range(1, world.rows):
        if before is not None:
            before(k, x)
        for _ in range(fine):
            x = tuple(a + h * d for a, d in zip(x, rate(k, x), strict=True))
        if kicks is not None:
            x = tuple(a + float(b) for a, b in zip(x, kicks[k], strict=True))
        found[k] = x
    return found


def lagged(values: Array, time_constant: float, dt: float) -> Array:
    """A sensor that follows with a time constant (rows,)."""
    shown, a = values.copy(), float(np.exp(-dt / time_constant))
    for k in range(1, len(values)):
        shown[k] = a * shown[k - 1] + (1 - a) * values[k]
    return shown


def dragged(asked: Array, band: float) -> Array:
    """What a part does that moves only when asked to by more than a band (rows,)."""
    at, x = np.empty_like(asked), float(asked[0])
    for k, u in enumerate(asked):
        x = min(max(x, float(u) - band), float(u) + band)
        at[k] = x
    return at
