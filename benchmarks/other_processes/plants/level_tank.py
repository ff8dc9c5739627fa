"""A tank with an inlet valve and a free outlet, its level controlled or not. The plant's parts stick, leak and clog."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, MOVES, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, dragged, integrate

DT = 10.0


def make_model() -> Model:
    """Inflow in proportion to the valve, outflow by the root of the level."""

    def equations(m: Scope) -> None:
        level = m.state("level")
        opening = m.site("valve", m.input("opening"), "actuator", unit="-")
        outlet = m.site("outlet_valve", m.input("outlet"), "actuator", unit="-")
        inflow = m.site("inflow", m.parameter("supply") * opening, "flow", unit="m/s")
        outflow = m.site(
            "outflow", m.parameter("discharge") * outlet * ca.sqrt(ca.fmax(level, 1e-4)), "flow", unit="m/s"
        )
        m.derivative("level", 1e-3 * (inflow - outflow))
        m.output("level", m.site("gauge", level, "sensor", "offset", unit="m"))

    return Model(
        name="level tank",
        states=(Quantity("level", "m", "", 0.0, 5.0, scale=0.3),),
        inputs=(Quantity("opening", "-", "", 0.0, 1.0), Quantity("outlet", "-", "", 0.0, 1.0)),
        parameters=(estimated("supply", 8.0, "mm/s"), estimated("discharge", 8.0, "-")),
        outputs=(Quantity("level", "m", "", scale=0.3),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"level": 1.0},
    )


def plant(w: World) -> Columns:
    """The pressure of the supply wanders; the level is controlled by the inlet valve, or not."""
    supply, discharge, power = w.off(10.0), w.off(9.0), 0.5 + w.extra(-0.04, 0.04)
    asked, outlet = w.hold((0.3, 0.8), 15, 60), w.hold((0.35, 0.65), 25, 90)
    target = w.hold((0.7, 1.6), 60, 150)
    pressure, kicks = w.wander(1500.0, 0.02), 0.001 * w.rich * w.record.standard_normal((w.rows, 2))
    at = w.onset()
    least, most, band, stuck = 0.0, 1.0, 0.0, np.zeros(w.rows)
    hole, clog, slip = np.zeros(w.rows), np.zeros(w.rows), np.zeros(w.rows)
    if w.case == "valve sticks":
        band = float(w.fault.uniform(0.06, 0.12))
    elif w.case == "valve leaks":
        least = float(w.fault.uniform(0.45, 0.55))
    elif w.case == "valve limit":
        most = float(w.fault.uniform(0.5, 0.6))
    elif w.case == "valve stuck":
        stuck[:] = w.fault.uniform(0.4, 0.7)
    elif w.case == "leak":
        hole[at:] = w.fault.uniform(0.6, 1.5)
    elif w.case == "outlet clogs":
        clog[at:] = w.fault.uniform(0.15, 0.35) * np.minimum(np.arange(w.rows - at) / (0.15 * w.rows), 1)
    elif w.case == "gauge slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.08, 0.2)
    elif w.case == "gauge off":
        slip[:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.1, 0.25)
    given = dragged(asked, band)

    def control(k: int, x: tuple[float, ...]) -> None:
        error = float(target[k] - x[0] - slip[k])
        asked[k] = float(np.clip(0.5 + 0.8 * error + 0.8 / 900.0 * x[1], 0.05, 1.0))
        given[k] = min(max(given[k - 1], asked[k] - band), asked[k] + band)

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        level = max(x[0], 0.0)
        opening = stuck[k] or min(max(given[k], least), most)
        out = (discharge * outlet[k] * (1 - clog[k]) + hole[k]) * level**power
        error = float(target[k] - x[0] - slip[k])
        free = 0.05 < asked[k] < 1.0 or (asked[k] <= 0.05) == (error > 0)
        return 1e-3 * (supply * opening * (1 + pressure[k]) - out), error * free

    x = integrate(rate, (1.0, 0.0), w, 5, kicks=kicks * [1, 0], before=control if w.feedback else None)
    return {"opening": asked, "outlet": outlet, "level_m": np.maximum(x[:, 0], 0.0) + slip}


VALVE: tuple[Pair, ...] = tuple(("valve", d) for d in (*ENDS, "opening"))
STAYS: tuple[Pair, ...] = (("valve", "own_value"), ("valve", SHIFT))
PROCESS = Process(
    "level_tank",
    DT,
    (500, 1500),
    make_model,
    plant,
    {"level_m": 0.004},
    {
        NOTHING: Case(()),
        "valve sticks": Case((("valve", MOVES), ("valve", "own_value"))),
        "valve leaks": Case((*VALVE, ("valve", SHIFT), ("inflow", "opening"))),
        "valve limit": Case((*VALVE, ("valve", SHIFT), ("inflow", "opening"))),
        "valve stuck": Case((*STAYS, ("valve", "saturation")), "reference"),
        "leak": Case((("outflow", EVENT), ("outlet_valve", EVENT))),
        "outlet clogs": Case((("outflow", EVENT), ("outlet_valve", EVENT))),
        "gauge slips": Case((("gauge", EVENT),), "alone"),
        "gauge off": Case((("gauge", SHIFT), ("gauge", "own_value")), "reference"),
    },
    {
        ("outflow", "level"): "the exponent of the outflow is not quite a half",
    },
    True,
)
