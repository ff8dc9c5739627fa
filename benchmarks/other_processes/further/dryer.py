"""Air that a fan blows through a heated tube. The plant's tube is a second store, and the air takes its time."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 1.0


def make_model() -> Model:
    """One store of heat that the air carries away."""

    def equations(m: Scope) -> None:
        outlet = m.state("outlet")
        heat = m.site("heater", m.parameter("watts") * m.input("heating"), "actuator", unit="W")
        air = m.site("fan", m.parameter("air") * m.input("fan"), "actuator", unit="W/K")
        lost = m.site("loss", m.parameter("conductance") * (outlet - m.input("inlet")), "flow", unit="W")
        m.derivative("outlet", (heat - lost - air * (outlet - m.input("inlet"))) / m.parameter("store"))
        m.output("outlet", m.site("thermometer", outlet, "sensor", "offset", unit="K"))

    return Model(
        name="heated tube",
        states=(Quantity("outlet", "degC", "", scale=8.0),),
        inputs=(
            Quantity("heating", "-", "", 0.0, 1.0),
            Quantity("fan", "-", "", 0.0, 1.0),
            Quantity("inlet", "degC", "", movable=False, scale=3.0),
        ),
        parameters=(
            estimated("watts", 300.0, "W"),
            estimated("air", 10.0, "W/K"),
            estimated("conductance", 1.0, "W/K"),
            estimated("store", 60.0, "J/K"),
        ),
        outputs=(Quantity("outlet", "degC", "", scale=8.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"outlet": 35.0},
    )


def plant(w: World) -> Columns:
    """Air, tube, and a thermometer that sees the air later."""
    watts, air, conductance, store = w.off(280.0), w.off(9.0), w.off(1.2), w.off(50.0)
    exchange, tube = w.extra(0.5, 2.0), 200.0
    heating, fan = w.hold((0.1, 1.0), 10, 50), w.hold((0.4, 0.7, 1.0), 40, 120)
    inlet, mains = w.weather(22.0, 0.5, 300.0, 0.4), w.wander(150.0, 0.015)
    given, blown, slip, late, at = heating.copy(), fan.copy(), np.zeros(w.rows), 0.0, w.onset()
    if w.case == "heater limit":
        given = np.minimum(heating, w.fault.uniform(0.55, 0.75))
    elif w.case == "heater aged":
        given = w.fault.uniform(0.6, 0.8) * heating
    elif w.case == "inlet blocked":
        blown = fan * (1 - w.fault.uniform(0.25, 0.5) * w.episodes((1, 3), (20, 70)))
    elif w.case == "fan worn":
        blown = fan.copy()
        blown[at:] *= w.fault.uniform(0.6, 0.8)
    elif w.case == "fan does not slow down":
        blown = np.maximum(fan, 0.75)
    elif w.case == "thermometer slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(1.5, 4.0)
    elif w.case == "thermometer slow":
        late = float(w.fault.uniform(6.0, 18.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        outlet, wall = x
        flow = exchange * (outlet - wall)
        carried = air * blown[k] * (outlet - inlet[k])
        gained = watts * given[k] * (1 + mains[k]) - conductance * (outlet - inlet[k])
        return (gained - carried - flow) / store, (flow - 0.2 * w.rich * (wall - inlet[k])) / tube

    x = integrate(rate, (35.0, 35.0), w, 8)[:, 0]
    behind = round(w.extra(0.0, 2.4))
    x = np.concatenate([np.full(behind, x[0]), x[: w.rows - behind]])
    shown = lagged(x, late, w.dt) if late else x
    return {"heating": heating, "fan": fan, "inlet_degC": inlet, "outlet_degC": shown + slip}


PROCESS = Process(
    "dryer",
    DT,
    (500, 1400),
    make_model,
    plant,
    {"outlet_degC": 0.08},
    {
        NOTHING: Case(()),
        "heater limit": Case(tuple(("heater", d) for d in (*ENDS, "heating"))),
        "heater aged": Case((("heater", SHIFT), ("heater", "own_value"), ("heater", "heating")), "reference"),
        "inlet blocked": Case((("fan", EVENT),)),
        "fan worn": Case((("fan", EVENT),)),
        "fan does not slow down": Case(tuple(("fan", d) for d in (*ENDS, "fan"))),
        "thermometer slips": Case((("thermometer", EVENT),), "alone"),
        "thermometer slow": Case((("thermometer", "lag"), ("thermometer", "delay"))),
    },
    {
        ("loss", "outlet"): "the tube is a second store",
        ("thermometer", "delay"): "the air takes its time",
        ("thermometer", "lag"): "the air takes its time",
    },
)
