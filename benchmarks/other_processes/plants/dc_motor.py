"""A small direct-current motor. The plant has dry friction, a soft load, and an amplifier with limits."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 0.02


def make_model() -> Model:
    """Torque in proportion to the voltage, friction to the speed."""

    def equations(m: Scope) -> None:
        speed = m.state("speed")
        volts = m.site("amplifier", m.input("voltage"), "actuator", "offset", unit="V")
        torque = m.site("torque", m.parameter("gain") * volts, unit="rad/s2")
        friction = m.site("friction", m.parameter("damping") * speed, unit="rad/s2")
        load = m.site("load", 0.0 * speed, "process", "offset", unit="rad/s2")
        m.derivative("speed", torque - friction - load)
        m.output("speed", m.site("tachometer", speed, "sensor", "offset", unit="rad/s"))

    return Model(
        name="motor",
        states=(Quantity("speed", "rad/s", "", scale=20.0),),
        inputs=(Quantity("voltage", "V", "", -24.0, 24.0, scale=5.0),),
        parameters=(estimated("gain", 50.0, "rad/s2/V"), estimated("damping", 4.0, "1/s")),
        outputs=(Quantity("speed", "rad/s", "", scale=20.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"speed": 0.0},
    )


def plant(w: World) -> Columns:
    """Speed, with a fast current before it."""
    gain, damping = w.off(40.0), w.off(5.0)
    current, air = w.extra(0.002, 0.008), w.extra(0.0, 0.001)
    voltage = w.hold((-10.0, 10.0), 8, 40)
    rough = w.wander(0.5, 4.0)
    given, dry, load, late = voltage.copy(), 0.0, np.zeros(w.rows), 0.0
    if w.case == "dry friction":
        dry = float(w.fault.uniform(40.0, 100.0))
    elif w.case == "dead zone":
        band = float(w.fault.uniform(1.0, 2.5))
        given = voltage - np.clip(voltage, -band, band)
    elif w.case == "amplifier limit":
        given = np.minimum(voltage, w.fault.uniform(4.0, 7.0))
    elif w.case == "amplifier weak":
        given = w.fault.uniform(0.6, 0.8) * voltage
    elif w.case == "load":
        load = w.fault.uniform(60.0, 150.0) * w.episodes((1, 3), (40, 120))
    elif w.case == "tachometer slow":
        late = float(w.fault.uniform(0.08, 0.2))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        speed, volts = x
        follow = (given[k] - volts) / current if current else 0.0
        acting = volts if current else given[k]
        drag = damping * speed * (1 + air * abs(speed)) + dry * np.tanh(speed / 0.5) + load[k] + rough[k]
        return gain * acting - drag, follow

    x = integrate(rate, (0.0, given[0]), w, 20)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    shown = np.abs(shown) if w.case == "tachometer sign" else shown
    return {"voltage_V": voltage, "speed_rad_s": shown}


DRY = (("friction", "speed"), ("load", "speed"), ("amplifier", "own_value"), ("amplifier", "voltage"))
PROCESS = Process(
    "dc_motor",
    DT,
    (500, 1500),
    make_model,
    plant,
    {"speed_rad_s": 0.5},
    {
        NOTHING: Case(()),
        "dry friction": Case((*DRY, ("torque", "voltage"))),
        "dead zone": Case((("amplifier", "own_value"), ("amplifier", "voltage"), ("torque", "voltage"), *DRY[:2])),
        "amplifier limit": Case((("amplifier", "saturation"), *DRY[2:], ("torque", "voltage"))),
        "amplifier weak": Case((("amplifier", SHIFT), ("torque", SHIFT), ("amplifier", "own_value")), "reference"),
        "load": Case((("load", EVENT), ("amplifier", EVENT))),
        "tachometer slow": Case((("tachometer", "lag"), ("tachometer", "delay"))),
        "tachometer sign": Case((("tachometer", "own_value"), ("tachometer", "speed")), "alone"),
    },
    {
        ("friction", "speed"): "the drag of the air grows with the speed",
        ("amplifier", "lag"): "the current has an inductance",
        ("amplifier", "delay"): "the current has an inductance",
    },
)
