"""A heated box that is richer than its model: a wall, a wandering room, a lid that someone opens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT = 15.0
LIDS = ((1000.0, 1150.0), (2000.0, 2090.0), (3000.0, 3120.0))


def record(
    lids: Sequence[tuple[float, float]] = LIDS,
    rows: int = 260,
    seed: int = 0,
    zero: float = 0.0,
    stuck: tuple[float, float, float] | None = None,
) -> Dataset:
    """Temperature of the air while the heater is stepped; the loss is four times as large while the lid is open.

    The heater is `stuck` between two times [s] at a power [W].
    """
    rng = np.random.default_rng(seed)
    power: list[float] = []
    while len(power) < rows:
        power += [float(rng.choice([0.0, 30.0, 60.0, 90.0]))] * int(rng.integers(15, 35))
    u, y = np.array(power[:rows]), np.zeros(rows)
    air, wall, room, fine = 22.0, 22.0, 22.0, 15
    for k in range(rows):
        y[k] = air
        for j in range(fine if k + 1 < rows else 0):
            t, h = (k + j / fine) * DT, DT / fine
            room += h * (22.0 - room) / 3000.0 + 0.02 * np.sqrt(h / 60.0) * rng.normal()
            open_lid = any(a <= t < b for a, b in lids)
            flow = 3.0 * (air - wall)
            power_on = stuck[2] if stuck and stuck[0] <= t < stuck[1] else u[k + 1]
            air += h * (power_on - 0.8 * (air - room) * (4.0 if open_lid else 1.0) - flow) / 400.0
            wall += h * (flow - 0.2 * (wall - room)) / 2500.0
    y += 0.03 * rng.normal(size=rows) + zero
    return Dataset("box", DT * np.arange(rows, dtype=float), DT, u[:, None], y[:, None])


def model(zero: float = 0.0) -> Model:
    """Air and wall, a room of constant temperature; `zero` is the zero of the scale in degC."""

    def equations(m: Scope) -> None:
        air, wall = m.state("air"), m.state("wall")
        heater = m.site("heater", m.input("power"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (air - 22.0 - zero), "flow", unit="W")
        other = m.site("other_heat", 0.0 * air, "process", "offset", unit="W")
        flow = m.parameter("exchange") * (air - wall)
        m.derivative("air", (heater + other - loss - flow) / m.parameter("capacity"))
        m.derivative("wall", flow / m.parameter("wall_capacity"))
        m.output("thermometer", m.site("thermometer", air, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 30, upper=30 * value, scale=value / 3, role="estimated")

    return Model(
        name="box",
        states=(Quantity("air", "degC", "", scale=3.0), Quantity("wall", "degC", "", scale=3.0)),
        inputs=(Quantity("power", "W", "", 0.0, 100.0),),
        parameters=(
            constant("conductance", 0.6, "W/K"),
            constant("exchange", 2.0, "W/K"),
            constant("capacity", 500.0, "J/K"),
            constant("wall_capacity", 2000.0, "J/K"),
        ),
        outputs=(Quantity("thermometer", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"air": 22.0 + zero, "wall": 22.0 + zero},
    )
