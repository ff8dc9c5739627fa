"""A heated tank in a draught: a process of a user's own, its truth in NumPy, and the physics its model lacks.

The truth loses more heat when the fan blows, (fan speed / 10)^0.6; the model's loss is constant. Physics and integrator
of the records (Euler, ten steps a row) share no code with the package.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope

CAPACITY = 4.0e5  # J/K
ROOM = 293.0  # K
DT = 30.0  # s
NOISE = 0.05  # K
EXPONENT = 0.6


def equations(m: Scope) -> None:
    temperature = m.state("temperature")
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator", unit="W")
    loss = m.site("heat_loss", m.parameter("loss") * (temperature - ROOM), unit="W")
    m.derivative("temperature", (heating - loss) / CAPACITY)
    m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))


def heated_tank() -> Model:
    return Model(
        name="heated-tank",
        states=(Quantity("temperature", "K", "", 273.0, 373.0, 10.0),),
        inputs=(Quantity("power", "W", "", 0.0, 1e4, 1e3), Quantity("fan_speed", "1/s", "", 0.0, 100.0, 5.0)),
        parameters=(
            Parameter("efficiency", 0.9, "-", "data sheet", None, 0.5, 1.0, 0.05, role="estimated"),
            Parameter("loss", 80.0, "W/K", "first guess", None, 1.0, 1000.0, 10.0, role="estimated"),
        ),
        outputs=(Quantity("temperature", "K", ""),),
        equations=equations,
        max_step_s=60.0,
        initial_guess={"temperature": 310.0},
    )


@dataclass(frozen=True)
class Truth:
    """How the real tank differs from its model: by the draught, an event, an error of the thermometer."""

    exponent: float = EXPONENT
    noise: float = NOISE
    loss_step: float = 0.0
    """Relative step of the loss in the middle of the record."""
    offset: float = 0.0
    """Added to the thermometer from the middle of the record on [K]."""


def moves(rows: int, low: float, high: float, hold: int, seed: int) -> FloatArray:
    levels = np.random.default_rng(seed).uniform(low, high, rows // hold + 1)
    found: FloatArray = np.repeat(levels, hold)[:rows]
    return found


def tank_record(
    truth: Truth | None = None, rows: int = 600, seed: int = 0, inputs: FloatArray | None = None
) -> Dataset:
    """Record of a tank whose fan and power move, or are `inputs` (N, 2)."""
    truth = truth or Truth()
    if inputs is None:
        inputs = np.column_stack([moves(rows, 500, 3000, 40, seed + 100), moves(rows, 5, 20, 25, seed + 200)])
    temperature, seen = 305.0, []
    for k, (power, fan) in enumerate(inputs):
        loss = 60.0 * (1 + truth.loss_step * (k >= rows // 2)) * (fan / 10) ** truth.exponent
        for _ in range(10):
            temperature += DT / 10 * (0.9 * power - loss * (temperature - ROOM)) / CAPACITY
        seen.append(temperature + truth.offset * (k >= rows // 2))
    y = np.array(seen) + truth.noise * np.random.default_rng(seed).standard_normal(len(inputs))
    return Dataset("tank", DT * np.arange(1.0, len(inputs) + 1), DT, inputs, y[:, None])


def changed(record: Dataset, outputs: FloatArray) -> Dataset:
    """The record with other measurements (N,)."""
    return replace(record, outputs=outputs[:, None])
