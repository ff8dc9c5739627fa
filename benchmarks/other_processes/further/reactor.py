"""A stirred tank in which a reaction gives off heat. The plant's jacket is a store, and its mixing is not perfect."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import EVENT, MOVES, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, dragged, integrate, lagged

DT = 20.0
ACTIVATION, REFERENCE = 6000.0, 313.15
"""Activation energy over the gas constant, and the temperature at which the rate is its constant [K]."""


def make_model() -> Model:
    """Balances of the reactant and of heat; the rate follows Arrhenius."""

    def equations(m: Scope) -> None:
        reactant, hot = m.state("reactant"), m.state("temperature")
        flow = m.site("pump", m.input("flow"), "actuator", unit="L/min")
        feed = m.site("feed", m.input("strength"), "feed", unit="mol/L")
        kelvin = hot + 273.15
        fast = m.parameter("speed") * ca.exp(-ACTIVATION * (1 / kelvin - 1 / REFERENCE))
        reaction = m.site("reaction", fast * reactant, "flow", unit="mol/L/min")
        coolant = m.site("cooler", m.input("coolant"), "actuator", "offset", unit="K")
        cooling = m.site("transfer", m.parameter("transfer") * (hot - coolant), "flow", unit="K/min")
        m.derivative("reactant", (flow / 100.0 * (feed - reactant) - reaction) / 60.0)
        warming = m.parameter("heat") * reaction - cooling
        m.derivative("temperature", (flow / 100.0 * (m.input("feed_temperature") - hot) + warming) / 60.0)
        m.output("reactant", m.site("analyser", reactant, "sensor", "offset", unit="mol/L"))
        m.output("temperature", m.site("thermometer", hot, "sensor", "offset", unit="K"))

    return Model(
        name="stirred reactor",
        states=(
            Quantity("reactant", "mol/L", "", 0.0, 5.0, scale=0.3),
            Quantity("temperature", "degC", "", 0.0, 150.0, scale=5.0),
        ),
        inputs=(
            Quantity("flow", "L/min", "", 0.0, 30.0),
            Quantity("strength", "mol/L", "", 0.0, 5.0, movable=False, scale=0.3),
            Quantity("coolant", "degC", "", 0.0, 60.0),
            Quantity("feed_temperature", "degC", "", movable=False, scale=5.0),
        ),
        parameters=(
            estimated("speed", 0.12, "1/min"),
            estimated("heat", 25.0, "K L/mol"),
            estimated("transfer", 0.12, "1/min"),
        ),
        outputs=(
            Quantity("reactant", "mol/L", "", scale=0.3),
            Quantity("temperature", "degC", "", scale=5.0),
        ),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"reactant": 1.0, "temperature": 55.0},
    )


def plant(w: World) -> Columns:
    """The same, with a jacket between coolant and tank, and a catalyst that is never quite the same."""
    speed, heat, transfer = w.off(0.1), w.off(28.0), w.off(0.13)
    jacket = w.extra(40.0, 120.0)
    flow, coolant = w.hold((8.0, 20.0), 15, 60), w.hold((15.0, 40.0), 20, 70)
    strength = w.weather(2.0, 0.05, 3600.0, 0.05)
    warm, alive = w.weather(25.0, 2.0, 7200.0, 0.5), w.wander(2400.0, 0.03)
    given, pumped, active, clean = coolant.copy(), flow.copy(), np.ones(w.rows), np.ones(w.rows)
    fed, slip, late, at = strength.copy(), np.zeros(w.rows), 0.0, w.onset()
    if w.case == "catalyst poisoned":
        active[at:] = w.fault.uniform(0.5, 0.75)
    elif w.case == "jacket fouls":
        clean = np.linspace(1.0, w.fault.uniform(0.5, 0.7), w.rows)
    elif w.case == "pump gives less":
        pumped = w.fault.uniform(0.65, 0.8) * flow
    elif w.case == "coolant valve sticks":
        given = dragged(coolant, float(w.fault.uniform(3.0, 6.0)))
    elif w.case == "coolant lost":
        clean = 1 - w.fault.uniform(0.5, 0.9) * w.episodes((1, 3), (15, 45))
    elif w.case == "thermometer slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(2.0, 5.0)
    elif w.case == "analyser slow":
        late = float(w.fault.uniform(120.0, 360.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        reactant, hot, cold = x
        fast = speed * active[k] * (1 + alive[k]) * float(np.exp(-ACTIVATION * (1 / (hot + 273.15) - 1 / REFERENCE)))
        through, reaction = pumped[k] / 100.0, fast * reactant
        follows = (given[k] - cold) / jacket if jacket else 0.0
        outside = cold if jacket else given[k]
        warming = heat * reaction - transfer * clean[k] * (hot - outside)
        return (
            (through * (fed[k] - reactant) - reaction) / 60.0,
            (through * (warm[k] - hot) + warming) / 60.0,
            follows,
        )

    x = integrate(rate, (1.0, 55.0, coolant[0]), w, 4)
    reactant = lagged(x[:, 0], late, w.dt) if late else x[:, 0]
    inputs = {"flow_L_min": flow, "strength_mol_L": strength, "coolant_degC": coolant, "feed_temperature_degC": warm}
    return inputs | {"reactant_mol_L": reactant, "temperature_degC": x[:, 1] + slip}


PROCESS = Process(
    "reactor",
    DT,
    (500, 1300),
    make_model,
    plant,
    {"reactant_mol_L": 0.01, "temperature_degC": 0.15},
    {
        NOTHING: Case(()),
        "catalyst poisoned": Case((("reaction", EVENT),)),
        "jacket fouls": Case((("transfer", EVENT),)),
        "pump gives less": Case((("pump", SHIFT), ("pump", "own_value"), ("pump", "flow")), "reference"),
        "coolant valve sticks": Case((("cooler", MOVES), ("cooler", "delay"))),
        "coolant lost": Case((("transfer", EVENT), ("cooler", EVENT))),
        "thermometer slips": Case((("thermometer", EVENT),), "alone"),
        "analyser slow": Case((("analyser", "lag"), ("analyser", "delay"))),
    },
    {
        ("cooler", "lag"): "the jacket is a store",
        ("cooler", "delay"): "the jacket is a store",
        ("transfer", "temperature"): "the jacket is a store",
    },
)
