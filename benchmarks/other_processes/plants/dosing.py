"""Chlorine in a basin, its dose controlled or not. The plant's decay depends on the temperature, its doser sticks."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, MOVES, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, dragged, integrate, lagged

DT = 60.0


def make_model() -> Model:
    """A stirred basin: dose, wash-out, and a decay of first order."""

    def equations(m: Scope) -> None:
        residual = m.state("residual")
        dose = m.site("doser", m.input("dose"), "actuator", unit="mg/s")
        decay = m.site("decay", m.parameter("decay") * residual, unit="mg/L/h")
        wash = m.site("wash_out", m.input("flow") * residual, "flow", unit="mg/s")
        demand = m.site("demand", 0.0 * residual, "process", "offset", unit="mg/s")
        m.derivative("residual", (dose - wash - demand) / m.parameter("volume") / 1000.0 - decay / 3600.0)
        m.output("residual", m.site("probe", residual, "sensor", "offset", unit="mg/L"))

    return Model(
        name="dosing",
        states=(Quantity("residual", "mg/L", "", 0.0, 50.0, scale=0.5),),
        inputs=(
            Quantity("dose", "mg/s", "", 0.0, 200.0, scale=10.0),
            Quantity("flow", "L/s", "", 0.0, 100.0, scale=3.0),
            Quantity("temperature", "degC", "", 0.0, 40.0, scale=3.0, movable=False),
        ),
        parameters=(estimated("decay", 0.5, "1/h"), estimated("volume", 30.0, "m3")),
        outputs=(Quantity("residual", "mg/L", "", scale=0.5),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"residual": 2.0},
    )


def plant(w: World) -> Columns:
    """Basin and a dead corner; the water's demand wanders; the dose is controlled or not."""
    decay, volume = w.off(0.6), w.off(25.0)
    corner, exchange = 0.15 * volume, w.extra(1.0, 4.0)
    dose, flow = w.hold((10.0, 50.0), 15, 60), w.hold((6.0, 14.0), 30, 120)
    target = w.hold((1.2, 2.6), 60, 150)
    temperature = w.weather(15.0, 3.0, 20_000.0, 1.0)
    kills, kicks = w.wander(3600.0, 0.8), 0.004 * w.rich * w.record.standard_normal((w.rows, 3))
    at, warm, band, most, late = w.onset(), w.extra(0.0, 0.01), 0.0, 999.0, 0.0
    bloom, stuck, off = np.zeros(w.rows), 0.0, 0.0
    if w.case == "warm decay":
        warm = float(w.fault.uniform(0.1, 0.2))
    elif w.case == "doser sticks":
        band = float(w.fault.uniform(4.0, 8.0))
    elif w.case == "doser limit":
        most = float(w.fault.uniform(26.0, 34.0))
    elif w.case == "doser stuck":
        stuck = float(w.fault.uniform(15.0, 40.0))
    elif w.case == "pollution":
        bloom = w.fault.uniform(6.0, 15.0) * w.episodes((1, 3), (30, 90))
    elif w.case == "probe slow":
        late = float(w.fault.uniform(300.0, 800.0))
    elif w.case == "probe slips":
        off = float(w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.3, 0.6))
    given, slips = dragged(dose, band), np.where(np.arange(w.rows) >= at, off, 0.0)

    def control(k: int, x: tuple[float, ...]) -> None:
        error = float(target[k] - x[0] - slips[k])
        dose[k] = float(np.clip(30.0 + 15.0 * error + 15.0 / 2400.0 * x[2], 0.0, 80.0))
        given[k] = min(max(given[k - 1], dose[k] - band), dose[k] + band)

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        main, aside, _ = x
        acting = stuck or min(given[k], most)
        lost = decay / 3600.0 * np.exp(warm * (temperature[k] - 15.0)) * main
        large = 1000.0 * (volume - (corner if exchange else 0.0))
        taken = flow[k] * main + kills[k] + bloom[k] - exchange * (aside - main)
        error = float(target[k] - x[0] - slips[k])
        change = (acting - taken) / large - lost
        return change, exchange * (main - aside) / (1000.0 * corner), error * (0.0 < dose[k] < 80.0)

    x = integrate(rate, (2.0, 2.0, 0.0), w, 6, kicks=kicks * [1, 0, 0], before=control if w.feedback else None)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    return {"dose_mg_s": dose, "flow_L_s": flow, "temperature_degC": temperature, "residual_mg_L": shown + slips}


DOSER: tuple[Pair, ...] = tuple(("doser", d) for d in (*ENDS, "dose"))
PROCESS = Process(
    "dosing",
    DT,
    (600, 1500),
    make_model,
    plant,
    {"residual_mg_L": 0.02},
    {
        NOTHING: Case(()),
        "warm decay": Case((("decay", "temperature"),), "alone"),
        "doser sticks": Case((("doser", MOVES), ("doser", "own_value"))),
        "doser limit": Case(DOSER),
        "doser stuck": Case((("doser", "own_value"), ("doser", SHIFT), ("doser", "saturation")), "reference"),
        "pollution": Case((("demand", EVENT), ("doser", EVENT))),
        "probe slow": Case((("probe", "lag"), ("probe", "delay"))),
        "probe slips": Case((("probe", EVENT),), "alone"),
    },
    {
        ("demand", SHIFT): "the water has a demand of its own",
        ("decay", "temperature"): "the decay grows a little with the temperature",
        ("probe", "lag"): "there is a corner that mixes slowly",
        ("probe", "delay"): "there is a corner that mixes slowly",
        ("wash_out", "residual"): "the corner is a second store",
    },
    True,
)
