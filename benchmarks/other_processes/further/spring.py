"""A mass on a spring, moved by a coil. The plant's spring hardens, and its slide is not free of dry friction."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 0.05


def make_model() -> Model:
    """Force of the coil, of the spring and of friction, each over the mass."""

    def equations(m: Scope) -> None:
        position, speed = m.state("position"), m.state("speed")
        coil = m.site("coil", m.parameter("gain") * m.input("volts"), "actuator", unit="mm/s2")
        spring = m.site("spring", m.parameter("stiffness") * position, unit="mm/s2")
        friction = m.site("friction", m.parameter("damping") * speed, unit="mm/s2")
        push = m.site("push", 0.0 * speed, "process", "offset", unit="mm/s2")
        m.derivative("position", speed)
        m.derivative("speed", coil + push - spring - friction)
        m.output("position", m.site("gauge", position, "sensor", "offset", unit="mm"))

    return Model(
        name="mass on a spring",
        states=(Quantity("position", "mm", "", scale=5.0), Quantity("speed", "mm/s", "", scale=15.0)),
        inputs=(Quantity("volts", "V", "", -5.0, 5.0),),
        parameters=(
            estimated("gain", 30.0, "mm/s2/V"),
            estimated("stiffness", 12.0, "1/s2"),
            estimated("damping", 1.0, "1/s"),
        ),
        outputs=(Quantity("position", "mm", "", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"position": 0.0, "speed": 0.0},
    )


def plant(w: World) -> Columns:
    """The same, and a little harder at large strokes, with a floor that shakes."""
    gain, stiffness, damping = w.off(28.0), w.off(13.0), w.off(1.2)
    hardens, dry = w.extra(0.0, 0.004), w.extra(0.0, 0.8)
    volts, at = w.hold((-3.0, 3.0), 8, 40), w.onset()
    shakes = w.wander(1.0, 2.0)
    given, push, slip, soft, late = volts.copy(), np.zeros(w.rows), np.zeros(w.rows), np.ones(w.rows), 0.0
    if w.case == "dry friction":
        dry = float(w.fault.uniform(8.0, 20.0))
    elif w.case == "coil limit":
        given = np.minimum(volts, w.fault.uniform(1.2, 2.0))
    elif w.case == "coil weak":
        given = w.fault.uniform(0.6, 0.8) * volts
    elif w.case == "coil idles":
        band = float(w.fault.uniform(0.4, 0.9))
        given = volts - np.clip(volts, -band, band)
    elif w.case == "someone leans on it":
        push = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(20.0, 45.0) * w.episodes((1, 3), (30, 90))
    elif w.case == "spring cracks":
        soft[at:] = w.fault.uniform(0.6, 0.75)
    elif w.case == "gauge slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(1.5, 4.0)
    elif w.case == "gauge slow":
        late = float(w.fault.uniform(0.15, 0.4))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        position, speed = x
        force = gain * given[k] + push[k] + shakes[k]
        back = stiffness * soft[k] * position * (1 + hardens * position**2)
        return speed, force - back - damping * speed - dry * float(np.tanh(speed / 0.5))

    x = integrate(rate, (0.0, 0.0), w, 20)[:, 0]
    return {"volts_V": volts, "position_mm": (lagged(x, late, w.dt) if late else x) + slip}


PROCESS = Process(
    "spring",
    DT,
    (400, 1000),
    make_model,
    plant,
    {"position_mm": 0.05},
    {
        NOTHING: Case(()),
        "dry friction": Case((("friction", "speed"), ("push", "speed"))),
        "coil limit": Case(tuple(("coil", d) for d in (*ENDS, "volts"))),
        "coil weak": Case((("coil", SHIFT), ("coil", "own_value"), ("coil", "volts")), "reference"),
        "coil idles": Case((("coil", "own_value"), ("coil", "volts"))),
        "someone leans on it": Case((("push", EVENT), ("coil", EVENT))),
        "spring cracks": Case((("spring", EVENT),)),
        "gauge slips": Case((("gauge", EVENT),), "alone"),
        "gauge slow": Case((("gauge", "lag"), ("gauge", "delay"))),
    },
    {
        ("spring", "position"): "the spring hardens",
        ("friction", "speed"): "the slide is a little dry",
        ("push", "speed"): "the slide is a little dry",
        ("push", "position"): "the spring hardens",
    },
)
