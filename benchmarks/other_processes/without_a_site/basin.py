"""A stirred basin with a pump out of it and a salt that flows in. Water leaks out, or rain that nobody measures."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 30.0
AREA = 2.0  # m2


def make_model() -> Model:
    """Balances of water and of salt; the level is measured, and what is in the basin."""

    def equations(m: Scope) -> None:
        level, salt = m.state("level"), m.state("salt")
        into = m.site("inflow", m.input("inflow"), "feed", unit="m3/s")
        out = m.site("pump", m.parameter("pump") * m.input("speed"), "actuator", unit="m3/s")
        decay = m.site("decay", m.parameter("decay") * salt, "process", unit="g/m3/s")
        m.derivative("level", (into - out) / AREA)
        m.derivative("salt", into * (m.input("feed") - salt) / (AREA * level) - decay)
        m.output("level", m.site("level_gauge", level, "sensor", "offset", unit="m"))
        m.output("salt", m.site("salt_probe", salt, "sensor", unit="g/m3"))

    parameters: tuple[Parameter, ...] = (estimated("pump", 0.01, "m3/s"), estimated("decay", 2e-4, "1/s"))
    return Model(
        name="basin",
        states=(Quantity("level", "m", "", 0.05, 5.0, scale=0.3), Quantity("salt", "g/m3", "", 0.0, 100.0, scale=5.0)),
        inputs=(
            Quantity("inflow", "m3/s", "", 0.0, 0.05, movable=False),
            Quantity("speed", "-", "", 0.0, 1.2),
            Quantity("feed", "g/m3", "", 0.0, 100.0, movable=False),
        ),
        parameters=parameters,
        outputs=(Quantity("level", "m", "", 0.0, 5.0), Quantity("salt", "g/m3", "", 0.0, 100.0)),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"level": 2.0, "salt": 20.0},
    )


def plant(w: World) -> Columns:
    """The pump gives a little less against a low level, whose set point its controller keeps."""
    pump, decay, weak = w.off(0.011), w.off(2.2e-4), w.extra(0.0, 0.02)
    inflow, feed = w.hold((0.002, 0.007), 20, 80), w.hold((20.0, 60.0), 40, 120)
    speed, target, at = np.zeros(w.rows), w.hold((1.6, 2.4), 60, 150), w.onset()
    stirred = w.wander(1200.0, 0.01)
    leak, rain, wrong, given, slip, probe = (
        np.zeros(w.rows),
        np.zeros(w.rows),
        np.zeros(w.rows),
        1.0,
        np.zeros(w.rows),
        1.0,
    )
    if w.case == "leak":
        leak[at:] = w.fault.uniform(0.0008, 0.002)
    elif w.case == "rain":
        rain[at:] = w.fault.uniform(0.0008, 0.002)
    elif w.case == "feed read wrongly":
        wrong[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(6.0, 12.0)
    elif w.case == "pump weak":
        given = float(w.fault.uniform(0.65, 0.8))
    elif w.case == "probe slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.1, 0.25)
    elif w.case == "probe span":
        probe = float(w.fault.uniform(1.15, 1.3))

    def control(k: int, x: tuple[float, ...]) -> None:
        speed[k] = float(np.clip(0.4 + 1.5 * (x[0] - target[k]), 0.0, 1.2))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        level, salt = max(x[0], 0.05), x[1]
        out = given * pump * speed[k] * (1 + weak * (level - 2.0)) + leak[k]
        fresh = inflow[k] * (feed[k] - salt) - rain[k] * salt
        return (inflow[k] + rain[k] - out) / AREA, fresh * (1 + stirred[k]) / (AREA * level) - decay * salt

    x = integrate(rate, (2.0, 20.0), w, 10, before=control)
    return {
        "inflow_m3_s": inflow, "speed": speed, "feed_g_m3": feed + wrong, "level_m": x[:, 0],
        "salt_g_m3": probe * (1 + slip) * x[:, 1],
    }  # fmt: skip


WATER: tuple[Pair, ...] = (("balance of level", EVENT), ("loss of level", EVENT))
PROCESS = Process(
    "basin",
    DT,
    (500, 900),
    make_model,
    plant,
    {"level_m": 0.006, "salt_g_m3": 0.25},
    {
        NOTHING: Case(()),
        "leak": Case(WATER),
        "rain": Case((*WATER, ("loss of salt", EVENT))),
        "feed read wrongly": Case((("reading of feed", EVENT), ("balance of salt", EVENT), ("amount at decay", EVENT))),
        "pump weak": Case((("pump", SHIFT), *(("pump", d) for d in ENDS)), "reference"),
        "probe slips": Case((("salt_probe", EVENT),)),
        "probe span": Case((("salt_probe", SHIFT), ("salt_probe", "own_value")), "reference"),
    },
    {("pump", "level"): "the pump gives a little more against a high level"},
)
