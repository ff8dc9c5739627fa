"""A water heater fed with steam. The plant's transfer depends on the flow, its tubes foul, its sensors are off."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 5.0


def make_model() -> Model:
    """One stirred cell: heat from the steam, water through it."""

    def equations(m: Scope) -> None:
        outlet = m.state("outlet")
        flow = m.site("flow_meter", m.input("flow"), "sensor", unit="kg/s")
        steam = m.site("steam", m.input("steam"), "actuator", "offset", unit="K")
        heat = m.site("transfer", m.parameter("ua") * (steam - outlet), unit="kW")
        carried = 4.19 * flow * (outlet - m.input("inlet"))
        m.derivative("outlet", (heat - carried) / (4.19 * m.parameter("holdup")))
        m.output("outlet", m.site("thermometer", outlet, "sensor", "offset", unit="K"))

    return Model(
        name="heat exchanger",
        states=(Quantity("outlet", "degC", "", 0.0, 200.0, scale=5.0),),
        inputs=(
            Quantity("flow", "kg/s", "", 0.0, 20.0),
            Quantity("steam", "degC", "", 50.0, 200.0, scale=10.0),
            Quantity("inlet", "degC", "", 0.0, 100.0, scale=3.0, movable=False),
        ),
        parameters=(estimated("ua", 3.0, "kW/K"), estimated("holdup", 40.0, "kg")),
        outputs=(Quantity("outlet", "degC", "", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"outlet": 50.0},
    )


def plant(w: World) -> Columns:
    """Water and tube wall; steam pressure wanders about what is asked."""
    ua, holdup, wall, through = w.off(2.5), w.off(50.0), w.off(15.0), w.extra(8.0, 15.0)
    flow, steam = w.hold((0.8, 2.2), 20, 60), w.hold((105.0, 130.0), 25, 80)
    inlet = w.weather(15.0, 1.0, 3000.0, 1.0)
    bubbles, kicks = w.wander(400.0, 0.5), 0.03 * w.rich * w.record.standard_normal((w.rows, 2))
    at, share, fouled, off, late = w.onset(), 0.0, np.zeros(w.rows), 0.0, 0.0
    cold, seen = np.zeros(w.rows), 1.0
    if w.case == "flow dependent":
        share = float(w.fault.uniform(0.4, 0.8))
    elif w.case == "fouling":
        fouled[at:] = w.fault.uniform(0.15, 0.35) * np.minimum(np.arange(w.rows - at) / (0.25 * w.rows), 1)
    elif w.case == "fouled":
        fouled[:] = w.fault.uniform(0.15, 0.35)
    elif w.case == "steam trap":
        cold = w.fault.uniform(8.0, 20.0) * w.episodes((1, 3), (20, 60))
    elif w.case == "thermometer well":
        late = float(w.fault.uniform(30.0, 80.0))
    elif w.case == "thermometer off":
        off = float(w.fault.choice([-1.0, 1.0]) * w.fault.uniform(2.0, 4.0))
    elif w.case == "flow meter off":
        seen = float(w.fault.choice([0.8, 1.25]))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        water, tube, shown = x
        now = ua * (flow[k] / 1.5) ** share * (1 - fouled[k])
        hot = steam[k] + bubbles[k] - cold[k]
        heat, follow = now * (hot - water), 0.0
        if through:
            inner = now * through / (through - now)
            heat, follow = inner * (tube - water), (through * (hot - tube) - inner * (tube - water)) / (wall * 0.5)
        carried = 4.19 * flow[k] / seen * (water - inlet[k])
        return (heat - carried) / (4.19 * holdup), follow, (water - shown) / late if late else 0.0

    x = integrate(rate, (55.0, 100.0, 55.0), w, 20, kicks=np.column_stack([kicks[:, 0], 0 * flow, 0 * flow]))
    shown = x[:, 2] if late else x[:, 0]
    return {"flow_kg_s": flow, "steam_degC": steam, "inlet_degC": inlet, "outlet_degC": shown + off}


FOULS: tuple[Pair, ...] = (("transfer", EVENT), ("steam", EVENT))
PROCESS = Process(
    "heat_exchanger",
    DT,
    (500, 1500),
    make_model,
    plant,
    {"outlet_degC": 0.1},
    {
        NOTHING: Case(()),
        "flow dependent": Case((("transfer", "flow"),), "alone"),
        "fouling": Case(FOULS),
        "fouled": Case((("transfer", SHIFT),), "reference"),
        "steam trap": Case((("steam", EVENT), ("transfer", EVENT))),
        "thermometer well": Case((("thermometer", "lag"), ("thermometer", "delay"))),
        "thermometer off": Case((("thermometer", SHIFT), ("thermometer", "own_value")), "reference"),
        "flow meter off": Case((("flow_meter", SHIFT), ("flow_meter", "own_value")), "reference"),
    },
    {
        ("steam", "lag"): "the tube stores heat",
        ("steam", "delay"): "the tube stores heat",
    },
)
