"""A control valve: a chamber moves the stem, and the flow follows it. The plant's seat wears, its chamber leaks."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 0.5
SPRING, REST, SUPPLY = 1.8, 0.5, 3.2  # bar


def make_model() -> Model:
    """A positioner fills the chamber, whose pressure moves the stem against a spring; flow by a linear opening."""

    def equations(m: Scope) -> None:
        p, x = m.state("chamber"), m.state("stem")
        asked = m.site("positioner", m.input("command"), "actuator", unit="-")
        air = m.site("air", m.parameter("air"), "process", unit="bar/s")
        m.derivative("chamber", air * (asked - x) * (SUPPLY - p) / 2.0)
        m.derivative("stem", ((p - REST) / SPRING - x) / 0.6)
        opening = m.site("opening", m.parameter("kv") * x, "process", unit="m3/h")
        flow = opening * ca.sqrt(ca.fmax(m.input("difference"), 0.01))
        m.output("position", m.site("position_sensor", x, "sensor", "offset", unit="-"))
        m.output("chamber", m.site("chamber_gauge", p, "sensor", "offset", unit="bar"))
        m.output("flow", m.site("flow_meter", flow, "sensor", unit="m3/h"))

    parameters: tuple[Parameter, ...] = (estimated("air", 1.5, "bar/s"), estimated("kv", 20.0, "m3/h"))
    return Model(
        name="control valve",
        states=(Quantity("chamber", "bar", "", 0.0, 6.0, scale=0.2), Quantity("stem", "-", "", -0.3, 1.5, scale=0.1)),
        inputs=(Quantity("command", "-", "", 0.0, 1.0), Quantity("difference", "bar", "", 0.0, 20.0, movable=False)),
        parameters=parameters,
        outputs=(
            Quantity("position", "-", "", -0.5, 1.5),
            Quantity("chamber", "bar", "", 0.0, 6.0),
            Quantity("flow", "m3/h", "", -5.0, 200.0),
        ),
        equations=equations,
        max_step_s=DT / 4,
        starts_steady=False,
        initial_guess={"chamber": 1.4, "stem": 0.5},
    )


def plant(w: World) -> Columns:
    """The trim is not quite linear, and the stem is pushed by the flow."""
    air, kv, bent = w.off(1.7), w.off(22.0), w.extra(-0.1, 0.1)
    command, at = w.hold((0.2, 0.9), 10, 40), w.onset()
    difference = 3.5 + w.weather(0.0, 0.0, 40.0, 0.4)
    push, given, slip = w.wander(20.0, 0.004), 1.0, 0.0
    lost, seat, clogged = (np.zeros(w.rows) for _ in range(3))
    if w.case == "worn seat":
        seat[at:] = w.fault.uniform(2.0, 4.0)
    elif w.case == "leaking chamber":
        lost[at:] = w.fault.uniform(0.03, 0.08)
    elif w.case == "positioner weak":
        given = float(w.fault.uniform(0.7, 0.85))
    elif w.case == "position sensor off":
        slip = float(w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.04, 0.08))
    elif w.case == "clogged":
        clogged[at:] = w.fault.uniform(0.15, 0.3)

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        p, s = x
        filled = air * (given * command[k] - s) * (SUPPLY - p) / 2.0 - lost[k] * p
        return filled, ((p - REST) / SPRING + push[k] - s) / 0.6

    x = integrate(rate, (1.4, 0.5), w, 50)
    opening = (1 - clogged) * kv * x[:, 1] * (1 + bent * (x[:, 1] - 0.5)) + seat
    flow = opening * np.sqrt(np.maximum(difference, 0.01))
    return {
        "command": command, "difference_bar": difference, "position": x[:, 1] + slip, "chamber_bar": x[:, 0],
        "flow_m3_h": flow,
    }  # fmt: skip


CHAMBER: tuple[Pair, ...] = (("loss of chamber", EVENT), ("balance of chamber", EVENT))
PROCESS = Process(
    "valve",
    DT,
    (500, 900),
    make_model,
    plant,
    {"position": 0.003, "chamber_bar": 0.008, "flow_m3_h": 0.25},
    {
        NOTHING: Case(()),
        "worn seat": Case((("amount at opening", EVENT), ("opening", EVENT))),
        "leaking chamber": Case(CHAMBER),
        "positioner weak": Case((("positioner", SHIFT), *(("positioner", d) for d in ENDS)), "reference"),
        "position sensor off": Case((("position_sensor", SHIFT), ("position_sensor", "own_value")), "reference"),
        "clogged": Case((("opening", EVENT),)),
    },
    {("opening", "stem"): "the trim is not quite linear"},
)
