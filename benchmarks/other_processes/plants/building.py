"""A small building. The plant has a second store, sun, wind and guests."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import EVENT, NOTHING, Case, Process, estimated
from benchmarks.other_processes.world import Columns, World, integrate

DT = 300.0


def make_model(sun: bool = True) -> Model:
    """One store of heat, a loss to the outside; sun and wind are recorded, and not in the equations."""

    def equations(m: Scope) -> None:
        indoor = m.state("indoor")
        heating = m.site("heater", m.input("heating"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (indoor - m.input("outdoor")), "flow", unit="W")
        gains = m.site("gains", 0.0 * indoor, "process", "offset", unit="W")
        m.derivative("indoor", (heating + gains - loss) / (1.0e6 * m.parameter("capacity")))
        m.output("indoor", m.site("thermometer", indoor, "sensor", "offset", unit="K"))

    weather = (
        Quantity("outdoor", "degC", "", movable=False, scale=5.0),
        Quantity("wind", "m/s", "", 0.0, 60.0, movable=False, scale=3.0),
        *((Quantity("sun", "W/m2", "", 0.0, 2000.0, movable=False, scale=300.0),) if sun else ()),
    )
    return Model(
        name="building",
        states=(Quantity("indoor", "degC", "", scale=3.0),),
        inputs=(Quantity("heating", "W", "", 0.0, 2.0e4), *weather),
        parameters=(estimated("conductance", 150.0, "W/K"), estimated("capacity", 8.0, "MJ/K")),
        outputs=(Quantity("indoor", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"indoor": 20.0},
    )


def without_sun() -> Model:
    """The same where nobody recorded the sun."""
    return make_model(sun=False)


def plant(w: World) -> Columns:
    """Air and mass; the mass is coupled weakly unless it is what is the matter."""
    conductance, capacity = w.off(130.0), w.off(6.0e6)
    mass, exchange = w.off(5.0e7), w.extra(10.0, 30.0)
    heating = w.hold((0.0, 2000.0, 4000.0, 6000.0), 6, 40)
    outdoor = w.weather(6.0, 4.0, 30_000.0, 1.5)
    hour = (DT * np.arange(w.rows) / 3600.0 + w.record.uniform(0, 24)) % 24
    cloud = np.clip(0.6 + w.weather(0.0, 0.0, 7200.0, 0.3), 0.05, 1.0)
    sun = 700.0 * cloud * np.maximum(np.sin(np.pi * (hour - 7) / 10), 0) * ((hour > 7) & (hour < 17))
    wind = np.abs(w.weather(4.0, 1.0, 10_000.0, 2.0))
    people = w.wander(7200.0, 100.0)
    area, stir, window, given = 0.0, 0.0, np.zeros(w.rows), heating.copy()
    if w.case in ("sun", "sun not recorded"):
        area = float(w.fault.uniform(3.0, 6.0))
    elif w.case == "second store":
        exchange = float(w.fault.uniform(150.0, 300.0))
    elif w.case == "wind":
        stir = float(w.fault.uniform(0.08, 0.15))
    elif w.case == "window":
        window = w.fault.uniform(1.0, 2.5) * w.episodes((1, 4), (8, 30))
    elif w.case == "heater limit":
        given = np.minimum(heating, w.fault.uniform(3000.0, 4500.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        air, inside = x
        loss = conductance * (1 + stir * (wind[k] - 4.0) + window[k]) * (air - outdoor[k])
        flow = exchange * (air - inside)
        return (given[k] + area * sun[k] + people[k] - loss - flow) / capacity, flow / mass

    x = integrate(rate, (20.0, 20.0), w, 10)[:, 0]
    columns = {"heating_W": heating, "outdoor_degC": outdoor, "wind_m_s": wind}
    columns |= {} if w.case == "sun not recorded" else {"sun_W_m2": sun}
    return columns | {"indoor_degC": x}


STORE = (("loss", "indoor"), ("gains", "indoor"))
PROCESS = Process(
    "building",
    DT,
    (800, 1800),
    make_model,
    plant,
    {"indoor_degC": 0.05},
    {
        NOTHING: Case(()),
        "sun": Case((("gains", "sun"), ("heater", "sun")), "alone"),
        "sun not recorded": Case((("gains", EVENT),), "alone", "without_sun"),
        "second store": Case(STORE, "alone"),
        "wind": Case((("loss", "wind"),), "alone"),
        "window": Case((("loss", EVENT), ("gains", EVENT))),
        "heater limit": Case((("heater", "saturation"), ("heater", "own_value"), ("heater", "heating"))),
    },
    {
        ("loss", "indoor"): "there is a weakly coupled second store",
    },
)
