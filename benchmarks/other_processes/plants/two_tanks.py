"""Two tanks in series, filled by a pump. The plant's pump saturates, and its tanks leak."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 4.0


def make_model() -> Model:
    """Each tank flows out by the root of its level."""

    def equations(m: Scope) -> None:
        upper, lower = m.state("upper"), m.state("lower")
        pumped = m.site("pump", m.parameter("pump_gain") * m.input("volts"), "actuator", unit="cm/s")
        first = m.site("upper_outlet", m.parameter("k1") * ca.sqrt(ca.fmax(upper, 1e-3)), "flow", unit="cm/s")
        second = m.site("lower_outlet", m.parameter("k2") * ca.sqrt(ca.fmax(lower, 1e-3)), "flow", unit="cm/s")
        m.derivative("upper", pumped - first)
        m.derivative("lower", first - second)
        m.output("upper", m.site("upper_gauge", upper, "sensor", "offset", unit="cm"))
        m.output("lower", m.site("lower_gauge", lower, "sensor", "offset", unit="cm"))

    return Model(
        name="two tanks",
        states=tuple(Quantity(n, "cm", "", 0.0, 100.0, scale=4.0) for n in ("upper", "lower")),
        inputs=(Quantity("volts", "V", "", 0.0, 12.0),),
        parameters=(
            estimated("pump_gain", 0.1, "cm/s/V"),
            estimated("k1", 0.15, "-"),
            estimated("k2", 0.15, "-"),
        ),
        outputs=tuple(Quantity(n, "cm", "", scale=4.0) for n in ("upper", "lower")),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"upper": 8.0, "lower": 8.0},
    )


def plant(w: World) -> Columns:
    """Outlets that are not quite orifices, and a pump that hesitates."""
    gain, k1, k2 = w.off(0.1), w.off(0.16), w.off(0.15)
    bend = 0.5 + w.extra(-0.03, 0.03)
    volts = w.hold((2.5, 8.0), 10, 50)
    mains, kicks = w.wander(600.0, 0.015), 0.01 * w.rich * w.record.standard_normal((w.rows, 2))
    at, most, least = w.onset(), 99.0, 0.0
    hole, clog, slip, stays = np.zeros(w.rows), np.zeros(w.rows), np.zeros(w.rows), 0.0
    if w.case == "pump limit":
        most = float(w.fault.uniform(5.0, 6.3))
    elif w.case == "pump idles":
        least = float(w.fault.uniform(4.0, 5.0))
    elif w.case == "pump worn":
        gain *= float(w.fault.uniform(0.6, 0.8))
    elif w.case == "upper tank leaks":
        hole[at:] = w.fault.uniform(0.02, 0.05)
    elif w.case == "pipe clogs":
        clog = w.fault.uniform(0.15, 0.35) * w.episodes((1, 3), (30, 80))
    elif w.case == "lower gauge slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(1.0, 2.5)
    elif w.case == "gauge hangs":
        stays = 1.0

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        upper, lower = max(x[0], 0.0), max(x[1], 0.0)
        pumped = gain * min(max(volts[k], least), most) * (1 + mains[k])
        first, second = k1 * (1 - clog[k]) * upper**bend, k2 * lower**bend
        return pumped - first - hole[k] * upper**0.5, first - second

    x = integrate(rate, (8.0, 8.0), w, 6, kicks=kicks)
    lower = x[:, 1] + slip
    if stays:
        lower = np.full(w.rows, float(np.median(lower)))
    return {"volts_V": volts, "upper_cm": x[:, 0], "lower_cm": lower}


PUMP: tuple[Pair, ...] = tuple(("pump", d) for d in (*ENDS, "volts"))
PROCESS = Process(
    "two_tanks",
    DT,
    (500, 1500),
    make_model,
    plant,
    {"upper_cm": 0.06, "lower_cm": 0.06},
    {
        NOTHING: Case(()),
        "pump limit": Case(PUMP),
        "pump idles": Case(PUMP),
        "pump worn": Case((("pump", SHIFT), ("pump", "own_value"), ("pump", "volts")), "reference"),
        "upper tank leaks": Case((("pump", EVENT), ("upper_outlet", EVENT))),
        "pipe clogs": Case((("upper_outlet", EVENT),)),
        "lower gauge slips": Case((("lower_gauge", EVENT),), "alone"),
        "gauge hangs": Case((("lower_gauge", "own_value"),), "reference"),
    },
    {
        ("upper_outlet", "upper"): "the outlets are not quite orifices",
        ("lower_outlet", "lower"): "the outlets are not quite orifices",
    },
)
