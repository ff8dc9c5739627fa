"""An electrically heated block in a room. The plant has another mass, other heat, or a room that is read wrongly."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 20.0
CAPACITY = 2000.0  # J/K


def make_model() -> Model:
    """One store of a known capacity, whose loss follows the difference to the room."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        heat = m.site("heater", m.parameter("power") * m.input("heating"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (temperature - m.input("room")), "flow", unit="W")
        m.derivative("temperature", (heat - loss) / CAPACITY)
        m.output("block", m.site("thermometer", temperature, "sensor", "offset", unit="degC"))

    parameters: tuple[Parameter, ...] = (
        Parameter("power", 100.0, "W", "nameplate", lower=20.0, upper=500.0, scale=10.0, role="fixed"),
        estimated("conductance", 2.0, "W/degC"),
    )
    return Model(
        name="heated block",
        states=(Quantity("temperature", "degC", "", -50.0, 300.0, scale=5.0),),
        inputs=(Quantity("heating", "-", "", 0.0, 1.0), Quantity("room", "degC", "", 0.0, 40.0, movable=False)),
        parameters=parameters,
        outputs=(Quantity("block", "degC", "", -50.0, 300.0, scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"temperature": 25.0},
    )


def plant(w: World) -> Columns:
    """A draught wanders, and the thermometer answers a little late."""
    power, conductance = w.off(100.0, 0.02), w.off(2.3)
    heating, room, at = w.hold((0.0, 1.0), 15, 60), w.weather(20.0, 3.0, 7200.0, 0.7), w.onset()
    draught, late = w.wander(1500.0, 0.03), w.extra(5.0, 15.0)
    capacity, other, wrong, given, slip, less = CAPACITY, np.zeros(w.rows), np.zeros(w.rows), 1.0, np.zeros(w.rows), 0.0
    if w.case == "another mass":
        capacity *= float(w.fault.choice([0.6, 1.6]))
    elif w.case == "other heat":
        other[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(15.0, 35.0)
    elif w.case == "room read wrongly":
        wrong[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(4.0, 8.0)
    elif w.case == "heater weak":
        given = float(w.fault.uniform(0.6, 0.8))
    elif w.case == "thermometer slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(2.0, 5.0)
    elif w.case == "lagging":
        less = float(w.fault.uniform(0.4, 0.8))
    seen = room + wrong

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        loss = conductance * (1 + less) * (1 + draught[k]) * (x[0] - room[k])
        return ((power * given * heating[k] + other[k] - loss) / capacity,)

    x = integrate(rate, (25.0,), w, 10)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    return {"heating": heating, "room_degC": seen, "block_degC": shown + slip}


HEAT: tuple[Pair, ...] = (
    ("balance of temperature", EVENT),
    ("reading of room", EVENT),
    ("reading of heating", EVENT),
    ("amount at loss", EVENT),
)
PROCESS = Process(
    "block",
    DT,
    (400, 800),
    make_model,
    plant,
    {"block_degC": 0.08},
    {
        NOTHING: Case(()),
        "another mass": Case((("rate of temperature", SHIFT),), "reference"),
        "other heat": Case(HEAT),
        "room read wrongly": Case(HEAT),
        "heater weak": Case((("heater", SHIFT), *(("heater", d) for d in ENDS)), "reference"),
        "thermometer slips": Case((("thermometer", EVENT),), "alone"),
        "lagging": Case((("loss", SHIFT),), "reference"),
    },
    {("loss", "room"): "the draught wanders", ("loss", "temperature"): "the draught wanders"},
)
