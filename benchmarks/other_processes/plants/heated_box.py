"""A heated box in a room. The plant has a wall that stores heat, and someone opens its lid."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 15.0


def make_model() -> Model:
    """One store of heat, a loss to the room."""

    def equations(m: Scope) -> None:
        air = m.state("air")
        heating = m.site("heater", m.input("power"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (air - m.input("room")), "flow", unit="W")
        other = m.site("other_heat", 0.0 * air, "process", "offset", unit="W")
        m.derivative("air", (heating + other - loss) / m.parameter("capacity"))
        m.output("air", m.site("thermometer", air, "sensor", "offset", unit="K"))

    return Model(
        name="heated box",
        states=(Quantity("air", "degC", "in the box", scale=5.0),),
        inputs=(Quantity("power", "W", "", 0.0, 200.0), Quantity("room", "degC", "", movable=False, scale=3.0)),
        parameters=(estimated("conductance", 1.0, "W/K"), estimated("capacity", 800.0, "J/K")),
        outputs=(Quantity("air", "degC", "in the box", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"air": 25.0},
    )


def plant(w: World) -> Columns:
    """Air and wall; the wall takes part of the heat."""
    efficiency, conductance, capacity = w.off(1.0, 0.03), w.off(1.1), w.off(700.0)
    exchange, wall_capacity = w.extra(0.1, 0.6), w.off(4000.0)
    power, room = w.hold((0.0, 30.0, 60.0, 90.0), 12, 45), w.weather(21.0, 0.5, 3600.0, 0.5)
    draught, kicks = w.wander(1200.0, 0.05), 0.01 * w.rich * w.record.standard_normal((w.rows, 2))
    given, at, late = power.copy(), w.onset(), 0.0
    open_lid, guest, shift = np.zeros(w.rows), np.zeros(w.rows), np.zeros(w.rows)
    if w.case == "lid":
        open_lid = w.fault.uniform(1.5, 4.0) * w.episodes((1, 4), (6, 20))
    elif w.case == "other heat":
        guest = w.fault.uniform(12.0, 30.0) * w.episodes((1, 2), (40, 90))
    elif w.case == "heater limit":
        given = np.minimum(power, w.fault.uniform(50.0, 75.0))
    elif w.case == "heater aged":
        given = w.fault.uniform(0.5, 0.75) * power
    elif w.case == "thermometer slips":
        shift[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(2.0, 5.0)
    elif w.case == "thermometer slow":
        late = float(w.fault.uniform(60.0, 180.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        air, wall = x
        flow = exchange * (air - wall)
        loss = conductance * (1 + draught[k] + open_lid[k]) * (air - room[k])
        return (
            (efficiency * given[k] + guest[k] - loss - flow) / capacity,
            (flow - 0.1 * w.rich * (wall - room[k])) / wall_capacity,
        )

    first = room[0] + w.record.uniform(0, 15)
    x = integrate(rate, (first, first), w, 10, kicks=kicks)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    return {"power_W": power, "room_degC": room, "air_degC": shown + shift}


PROCESS = Process(
    "heated_box",
    DT,
    (400, 900),
    make_model,
    plant,
    {"air_degC": 0.05},
    {
        NOTHING: Case(()),
        "lid": Case((("loss", EVENT), ("other_heat", EVENT))),
        "other heat": Case((("other_heat", EVENT), ("heater", EVENT))),
        "heater limit": Case((("heater", "saturation"), ("heater", "own_value"), ("heater", "power"))),
        "heater aged": Case((("heater", SHIFT), ("heater", "power"), ("heater", "own_value")), "reference"),
        "thermometer slips": Case((("thermometer", EVENT),), "alone"),
        "thermometer slow": Case((("thermometer", "lag"), ("thermometer", "delay"))),
    },
    {
        ("loss", "air"): "the wall is a second store",
        ("other_heat", "air"): "the wall is a second store",
    },
)
