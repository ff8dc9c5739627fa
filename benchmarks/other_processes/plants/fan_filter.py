"""A fan that blows through a filter and a damper. The plant's filter clogs, and its damper sticks."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, MOVES, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, dragged, integrate, lagged

DT = 1.0


def make_model() -> Model:
    """Pressure by the square of the speed, resistance by the square of the flow."""

    def equations(m: Scope) -> None:
        flow = m.state("flow")
        pressure = m.site("fan", m.parameter("head") * m.input("speed") ** 2, "actuator", unit="Pa")
        damper = m.site("damper", m.input("damper"), "actuator", unit="-")
        across = m.site("filter", m.parameter("filter_drop") * flow * ca.fabs(flow), unit="Pa")
        behind = m.site("duct", m.parameter("duct_drop") * flow * ca.fabs(flow) / (0.1 + damper) ** 2, unit="Pa")
        m.derivative("flow", (pressure - across - behind) / m.parameter("inertia"))
        m.output("flow", m.site("flow_meter", flow, "sensor", unit="m3/s"))
        m.output("drop", m.site("drop_meter", across, "sensor", "offset", unit="Pa"))

    return Model(
        name="fan and filter",
        states=(Quantity("flow", "m3/s", "", -5.0, 20.0, scale=0.5),),
        inputs=(Quantity("speed", "-", "", 0.0, 1.2), Quantity("damper", "-", "", 0.0, 1.0)),
        parameters=(
            estimated("head", 800.0, "Pa"),
            estimated("filter_drop", 50.0, "Pa s2/m6"),
            estimated("duct_drop", 20.0, "Pa s2/m6"),
            estimated("inertia", 500.0, "Pa s2/m3"),
        ),
        outputs=(Quantity("flow", "m3/s", "", scale=0.5), Quantity("drop", "Pa", "", scale=50.0)),
        equations=equations,
        max_step_s=0.5,
        starts_steady=False,
        initial_guess={"flow": 1.5},
    )


def plant(w: World) -> Columns:
    """The filter is not quite turbulent, and the wind blows on the outlet."""
    head, sieve, duct, inertia = w.off(900.0), w.off(60.0), w.off(22.0), w.off(600.0)
    bend = 2.0 - w.extra(0.0, 0.15)
    speed, damper = w.hold((0.5, 1.0), 15, 50), w.hold((0.3, 0.9), 20, 60)
    gusts, kicks = w.wander(20.0, 15.0), 0.005 * w.rich * w.record.standard_normal((w.rows, 1))
    at, clog, band, least, late = w.onset(), np.zeros(w.rows), 0.0, 0.0, 0.0
    belt, seen, torn = np.zeros(w.rows), 1.0, 1.0
    if w.case == "filter clogs":
        clog[at:] = w.fault.uniform(0.5, 1.2) * np.minimum(np.arange(w.rows - at) / (0.3 * w.rows), 1)
    elif w.case == "filter clogged":
        clog[:] = w.fault.uniform(0.4, 1.0)
    elif w.case == "damper sticks":
        band = float(w.fault.uniform(0.08, 0.15))
    elif w.case == "damper leaks":
        least = float(w.fault.uniform(0.5, 0.65))
    elif w.case == "belt slips":
        belt = w.fault.uniform(0.1, 0.25) * w.episodes((1, 4), (15, 60))
    elif w.case == "flow meter slow":
        late = float(w.fault.uniform(5.0, 15.0))
    elif w.case == "flow meter off":
        seen = float(w.fault.choice([0.85, 1.15]))
    elif w.case == "laminar filter":
        torn = 2.0
    at_damper = np.maximum(dragged(damper, band), least)

    def drop(k: int, q: float) -> float:
        power = 1.2 if torn > 1 else bend
        return float(sieve * (1 + clog[k]) * np.sign(q) * abs(q) ** power)

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        q = x[0]
        pressure = head * (speed[k] * (1 - belt[k])) ** 2 - gusts[k]
        return ((pressure - drop(k, q) - duct * q * abs(q) / (0.1 + at_damper[k]) ** 2) / inertia,)

    x = integrate(rate, (1.5,), w, 20, kicks=kicks)[:, 0]
    across = np.array([drop(k, float(q)) for k, q in enumerate(x)])
    shown = lagged(x, late, w.dt) if late else x
    return {"speed": speed, "damper": damper, "flow_m3_s": seen * shown, "drop_Pa": across}


DAMPER: tuple[Pair, ...] = tuple(("damper", d) for d in (*ENDS, "damper"))
PROCESS = Process(
    "fan_filter",
    DT,
    (500, 1500),
    make_model,
    plant,
    {"flow_m3_s": 0.02, "drop_Pa": 3.0},
    {
        NOTHING: Case(()),
        "filter clogs": Case((("filter", EVENT),)),
        "filter clogged": Case((("filter", SHIFT),), "reference"),
        "damper sticks": Case((("damper", MOVES), ("damper", "own_value"))),
        "damper leaks": Case((*DAMPER, ("damper", SHIFT), ("duct", "damper"))),
        "belt slips": Case((("fan", EVENT),)),
        "flow meter slow": Case((("flow_meter", "lag"), ("flow_meter", "delay"))),
        "flow meter off": Case((("flow_meter", SHIFT), ("flow_meter", "own_value")), "reference"),
        "laminar filter": Case((("filter", "flow"),), "alone"),
    },
    {
        ("filter", "flow"): "the filter is not quite turbulent",
    },
)
