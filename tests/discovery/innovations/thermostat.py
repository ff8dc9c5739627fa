"""A plate that a Peltier element heats and cools: it sticks, idles about zero, or a draught or a lamp is beside it."""

from __future__ import annotations

from typing import Literal

import numpy as np

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, ROOM, CAPACITY, LOSS = 10.0, 20.0, 300.0, 2.0
BAND, ZONE, SWING, PERIOD, LAMP = 6.0, 5.0, 4.0, 700.0, 3.0
ON, FOR = 150.0, 220.0
"""When a lamp with a clock is on in each period [s]."""
Wrong = Literal["nothing", "hysteresis", "dead zone", "periodic", "cycle", "lamp"]


def record(wrong: Wrong, rows: int = 500, seed: int = 0) -> Dataset:
    """Temperature while the element follows a signal that wanders about zero; what is wrong is not told."""
    rng = np.random.default_rng(seed)
    asked = np.zeros(rows)
    for k in range(1, rows):
        asked[k] = 0.93 * asked[k - 1] + 6.0 * rng.normal()
    plate, room, position, y, fine = ROOM, ROOM, 0.0, np.zeros(rows), 10
    for k in range(rows):
        y[k] = plate
        for j in range(fine if k + 1 < rows else 0):
            t, h = (k + j / fine) * DT, DT / fine
            u = asked[k + 1]
            if wrong == "hysteresis":
                position = min(max(position, u - BAND), u + BAND)
                u = position
            elif wrong == "dead zone":
                u -= min(max(u, -ZONE), ZONE)
            other = SWING * np.sin(2 * np.pi * t / PERIOD + 1.0) if wrong == "periodic" else 0.0
            other += LAMP if wrong == "lamp" or (wrong == "cycle" and (t - ON) % PERIOD < FOR) else 0.0
            room += h * (ROOM - room) / 2000.0 + 0.02 * np.sqrt(h / 60.0) * rng.normal()
            plate += h * (u + other - LOSS * (plate - room)) / CAPACITY
    y += 0.03 * rng.normal(size=rows)
    return Dataset("plate", DT * np.arange(rows, dtype=float), DT, asked[:, None], y[:, None])


def model() -> Model:
    """One balance, the element as asked, and a room of constant temperature."""

    def equations(m: Scope) -> None:
        plate = m.state("plate")
        element = m.site("element", m.input("asked"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (plate - ROOM), "flow", "offset", unit="W")
        other = m.site("other_heat", 0.0 * plate, "process", "offset", unit="W")
        m.derivative("plate", (element + other - loss) / m.parameter("capacity"))
        m.output("thermometer", m.site("thermometer", plate, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 30, upper=30 * value, scale=value / 3, role="estimated")

    return Model(
        name="plate",
        states=(Quantity("plate", "degC", "", scale=3.0),),
        inputs=(Quantity("asked", "W", "", -60.0, 60.0),),
        parameters=(constant("conductance", 1.5, "W/K"), constant("capacity", 400.0, "J/K")),
        outputs=(Quantity("thermometer", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"plate": ROOM},
    )
