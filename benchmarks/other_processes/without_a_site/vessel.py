"""Compressed air: a valve into a vessel, an outlet, a gauge, a flow meter. The plant leaks; its volume is another."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 5.0
SUPPLY = 7.0  # bar


def make_model() -> Model:
    """Flow by the root of the difference of pressures, at the valve and at the outlet; the volume is a number."""

    def equations(m: Scope) -> None:
        p = m.state("pressure")
        opening = m.site("valve", m.parameter("kv") * m.input("opening"), "actuator", unit="bar0.5/s")
        inflow = opening * ca.sqrt(ca.fmax(SUPPLY - p, 1e-4))
        outflow = m.site("outlet", m.parameter("drain") * m.input("demand") * ca.sqrt(ca.fmax(p, 1e-4)), unit="bar/s")
        m.derivative("pressure", inflow - outflow)
        m.output("pressure", m.site("gauge", p, "sensor", "offset", unit="bar"))
        m.output("inflow", m.site("flow_meter", inflow, "sensor", unit="bar/s"))

    inputs = tuple(Quantity(name, "-", "", 0.0, 1.0) for name in ("opening", "demand"))
    parameters: tuple[Parameter, ...] = (estimated("kv", 0.05, "bar0.5/s"), estimated("drain", 0.05, "bar0.5/s"))
    return Model(
        name="compressed air",
        states=(Quantity("pressure", "bar", "", 0.0, SUPPLY, scale=0.5),),
        inputs=inputs,
        parameters=parameters,
        outputs=(Quantity("pressure", "bar", "", 0.0, 10.0), Quantity("inflow", "bar/s", "", -1.0, 1.0)),
        equations=equations,
        max_step_s=DT / 4,
        starts_steady=False,
        initial_guess={"pressure": 3.0},
    )


def plant(w: World) -> Columns:
    """The supply wanders a little, and a choked outlet is not quite a root."""
    kv, drain, power = w.off(0.055), w.off(0.045), 0.5 + w.extra(-0.03, 0.03)
    opening, demand = w.hold((0.1, 0.9), 12, 50), w.hold((0.3, 0.9), 20, 70)
    supply, at = SUPPLY * (1 + w.wander(800.0, 0.005)), w.onset()
    lost, volume, given, gap, shown, slip = np.zeros(w.rows), 1.0, opening.copy(), np.zeros(w.rows), 1.0, 0.0
    if w.case == "gas is lost":
        lost[at:] = w.fault.uniform(0.0015, 0.004)
    elif w.case == "another volume":
        volume = float(w.fault.choice([0.6, 1.6]))
    elif w.case == "bypass":
        gap[at:] = w.fault.uniform(0.1, 0.25)
    elif w.case == "valve weak":
        given = w.fault.uniform(0.65, 0.8) * opening
    elif w.case == "gauge off":
        slip = float(w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.3, 0.8))
    elif w.case == "meter span":
        shown = float(w.fault.uniform(1.15, 1.3))

    def into(k: int, p: float) -> float:
        return float(kv * given[k] * np.sqrt(max(supply[k] - p, 0.0)))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        p = max(x[0], 0.0)
        # a bypass opens beside valve and meter: what it brings is not seen
        unseen = float(kv * gap[k] * np.sqrt(max(supply[k] - p, 0.0)))
        return ((into(k, p) + unseen - drain * demand[k] * p**power - lost[k] * p) / volume,)

    p = integrate(rate, (3.0,), w, 10)[:, 0]
    inflow = np.array([into(k, float(p[k])) for k in range(w.rows)])
    return {"opening": opening, "demand": demand, "pressure_bar": p + slip, "inflow_bar_s": shown * inflow}


LOST = tuple((f"{place} of pressure", EVENT) for place in ("loss", "balance"))
PROCESS = Process(
    "vessel",
    DT,
    (500, 900),
    make_model,
    plant,
    {"pressure_bar": 0.015, "inflow_bar_s": 0.002},
    {
        NOTHING: Case(()),
        "gas is lost": Case((*LOST, ("amount at outlet", EVENT))),
        "another volume": Case((("rate of pressure", SHIFT),), "reference"),
        "bypass": Case((("balance of pressure", EVENT), ("loss of pressure", EVENT), ("amount at outlet", EVENT))),
        "valve weak": Case((("valve", SHIFT), *(("valve", d) for d in ENDS)), "reference"),
        "gauge off": Case((("gauge", SHIFT), ("gauge", "own_value")), "reference"),
        "meter span": Case((("flow_meter", "own_value"), ("flow_meter", SHIFT)), "reference"),
    },
    {("outlet", "pressure"): "the exponent of the outflow is not quite a half"},
)
