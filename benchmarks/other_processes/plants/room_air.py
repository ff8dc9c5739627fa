"""Carbon dioxide in a room with a fan and people who are counted. Windows and doors are not."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate, lagged

DT = 60.0


def make_model() -> Model:
    """One well-mixed room; fresh air by a fan and through leaks."""

    def equations(m: Scope) -> None:
        level = m.state("level")
        fan = m.site("fan", m.parameter("fan_air") * m.input("fan"), "actuator", unit="m3/h")
        leaks = m.site("infiltration", m.parameter("infiltration"), unit="m3/h")
        people = m.site("breath", m.parameter("breath") * m.input("people"), unit="m3/h")
        out = (fan + leaks) * (level - 420.0)
        m.derivative("level", (1e6 * people - out) / (3600.0 * 180.0))
        m.output("level", m.site("sensor", level, "sensor", "offset", unit="ppm"))

    return Model(
        name="room air",
        states=(Quantity("level", "ppm", "of carbon dioxide", 0.0, 2.0e4, scale=200.0),),
        inputs=(Quantity("fan", "-", "", 0.0, 1.0), Quantity("people", "-", "", 0.0, 100.0, movable=False)),
        parameters=(
            estimated("fan_air", 400.0, "m3/h"),
            estimated("infiltration", 50.0, "m3/h"),
            estimated("breath", 0.02, "m3/h"),
        ),
        outputs=(Quantity("level", "ppm", "", scale=200.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"level": 600.0},
    )


def plant(w: World) -> Columns:
    """Room and an alcove; people differ in what they breathe out, and the wind blows."""
    fan_air, leaks, breath = w.off(350.0), w.off(60.0), w.off(0.018)
    exchange = w.extra(40.0, 100.0)
    fan, people = w.hold((0.1, 0.3, 0.6, 1.0), 25, 90), np.round(w.hold((0.0, 9.0), 20, 90))
    effort, wind = w.wander(2400.0, 0.06), w.wander(5000.0, 0.15)
    at, most, late, off, given = w.onset(), 9.0, 0.0, 0.0, fan.copy()
    window, crowd = np.zeros(w.rows), np.zeros(w.rows)
    if w.case == "window":
        window = w.fault.uniform(3.0, 8.0) * w.episodes((1, 4), (15, 50))
    elif w.case == "uncounted guests":
        crowd = w.fault.integers(4, 9) * w.episodes((1, 3), (40, 90))
    elif w.case == "fan limit":
        most = float(w.fault.uniform(0.35, 0.5))
    elif w.case == "filter of the fan clogs":
        given[at:] *= w.fault.uniform(0.4, 0.6)
    elif w.case == "fan stuck":
        given[:] = w.fault.uniform(0.2, 0.7)
    elif w.case == "sensor slow":
        late = float(w.fault.uniform(300.0, 700.0))
    elif w.case == "sensor off":
        off = float(w.fault.choice([-1.0, 1.0]) * w.fault.uniform(80.0, 160.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        room, alcove = x
        air = fan_air * min(given[k], most) + leaks * (1 + wind[k]) * (1 + window[k])
        source = 1e6 * breath * (people[k] + crowd[k]) * (1 + effort[k])
        across = exchange * (alcove - room)
        volume = 180.0 - (30.0 if exchange else 0.0)
        return (source - air * (room - 420.0) + across) / (3600 * volume), -across / (3600 * 30.0)

    x = integrate(rate, (600.0, 600.0), w, 10)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    return {"fan": fan, "people": people, "level_ppm": shown + off}


FAN: tuple[Pair, ...] = tuple(("fan", d) for d in (*ENDS, "fan"))
PROCESS = Process(
    "room_air",
    DT,
    (600, 1500),
    make_model,
    plant,
    {"level_ppm": 6.0},
    {
        NOTHING: Case(()),
        "window": Case((("infiltration", EVENT),)),
        "uncounted guests": Case((("breath", EVENT),)),
        "fan limit": Case(FAN),
        "filter of the fan clogs": Case((("fan", EVENT),), "alone"),
        "fan stuck": Case((("fan", "own_value"), ("fan", SHIFT), ("fan", "saturation")), "reference"),
        "sensor slow": Case((("sensor", "lag"), ("sensor", "delay"))),
        "sensor off": Case((("sensor", SHIFT), ("sensor", "own_value")), "reference"),
    },
    {
        ("sensor", "lag"): "there is an alcove that mixes slowly",
        ("sensor", "delay"): "there is an alcove that mixes slowly",
    },
)
