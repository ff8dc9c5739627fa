"""A water heater: the user's model, and an independent simulation that fouls, or whose thermometer sits in a well."""

from __future__ import annotations

from typing import Literal

import numpy as np

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from tests.discovery.heated import moves

DT, UA, HOLDUP, INLET = 5.0, 2.6, 45.0, 15.0
FOULED, BEGINS, ENDS, LATE = 0.3, 1500.0, 2400.0, 60.0
Wrong = Literal["nothing", "fouls", "late"]


def model() -> Model:
    """4.19 holdup dT/dt = ua (steam - T) - 4.19 flow (T - inlet); ua and holdup are to be fitted."""

    def equations(m: Scope) -> None:
        outlet = m.state("outlet")
        flow = m.site("flow_meter", m.input("flow"), "sensor", unit="kg/s")
        steam = m.site("steam", m.input("steam"), "actuator", "offset", unit="K")
        heat = m.site("transfer", m.parameter("ua") * (steam - outlet), unit="kW")
        m.derivative("outlet", (heat - 4.19 * flow * (outlet - INLET)) / (4.19 * m.parameter("holdup")))
        m.output("outlet", m.site("thermometer", outlet, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 30, upper=30 * value, scale=value / 3, role="estimated")

    return Model(
        name="exchanger",
        states=(Quantity("outlet", "degC", "", 0.0, 200.0, scale=5.0),),
        inputs=(Quantity("flow", "kg/s", "", 0.0, 20.0), Quantity("steam", "degC", "", 50.0, 200.0, scale=10.0)),
        parameters=(constant("ua", 3.0, "kW/K"), constant("holdup", 40.0, "kg")),
        outputs=(Quantity("outlet", "degC", "", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"outlet": 60.0},
    )


def record(wrong: Wrong, rows: int = 600, seed: int = 0) -> Dataset:
    """Euler, five steps a row; the steam wanders a little about what is asked."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([moves(rows, 0.8, 2.2, 25, seed + 100), moves(rows, 105.0, 130.0, 35, seed + 200)])
    water = shown = 60.0
    bubbles, y = 0.0, np.zeros(rows)
    for k, (flow, steam) in enumerate(inputs):
        bubbles += (0.3 * np.sqrt(2 * DT / 300.0) * rng.normal()) - bubbles * DT / 300.0
        for j in range(5):
            t = (k + j / 5) * DT
            fouled = FOULED * np.clip((t - BEGINS) / (ENDS - BEGINS), 0.0, 1.0) if wrong == "fouls" else 0.0
            heat = UA * (1 - fouled) * (steam + bubbles - water)
            water += DT / 5 * (heat - 4.19 * flow * (water - INLET)) / (4.19 * HOLDUP)
            shown += DT / 5 * (water - shown) / LATE
        y[k] = (shown if wrong == "late" else water) + 0.1 * rng.normal()
    return Dataset("exchanger", DT * np.arange(1.0, rows + 1), DT, inputs, y[:, None])
