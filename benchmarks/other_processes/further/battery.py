"""A battery cell that is charged and discharged. The plant's voltage is no straight line, and it relaxes."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, NOTHING, SHIFT, Case, Process, estimated
from benchmarks.other_processes.world import Array, Columns, World, integrate, lagged

DT = 10.0


def make_model() -> Model:
    """Charge is counted; the voltage is that at rest, and what the resistance adds."""

    def equations(m: Scope) -> None:
        charge = m.state("charge")
        current = m.site("charger", m.input("current"), "actuator", "offset", unit="A")
        load = m.site("load", 0.0 * charge, "process", "offset", unit="A")
        resistance = m.site("resistance", m.parameter("ohms"), "process", unit="ohm")
        at_rest = m.site("at_rest", m.parameter("empty") + m.parameter("rise") * charge, "process", "offset", unit="V")
        m.derivative("charge", (current - load) / (3600.0 * m.parameter("capacity")))
        volts = at_rest + resistance * (current - load)
        m.output("volts", m.site("voltmeter", volts, "sensor", "offset", unit="V"))

    return Model(
        name="battery cell",
        states=(Quantity("charge", "-", "share of the capacity", 0.0, 1.2, scale=0.2),),
        inputs=(Quantity("current", "A", "into the cell", -3.0, 3.0),),
        parameters=(
            estimated("capacity", 2.0, "A h"),
            estimated("ohms", 0.06, "ohm"),
            estimated("empty", 3.3, "V", 2.0),
            estimated("rise", 0.8, "V"),
        ),
        outputs=(Quantity("volts", "V", "", scale=0.2),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"charge": 0.5},
    )


def _current(w: World, capacity: float) -> Array:
    """Charged where it is nearly empty, discharged where it is nearly full."""
    found, charge = list[float](), 0.5
    while len(found) < w.rows:
        size, long = float(w.record.uniform(0.2, 1.5)), int(w.record.integers(10, 50))
        sign = -1.0 if charge > 0.7 else 1.0 if charge < 0.3 else float(w.record.choice([-1.0, 1.0]))
        found += [sign * size] * long
        charge += sign * size * long * w.dt / (3600 * capacity)
    return np.array(found[: w.rows])


def plant(w: World) -> Columns:
    """The same, with a voltage at rest that bends at both ends, and one that relaxes after a change of current."""
    capacity, ohms = w.off(2.0), w.off(0.05)
    bend, slow_ohms, relaxes = w.extra(0.02, 0.06), w.extra(0.005, 0.015), 60.0
    current, at = _current(w, 2.0), w.onset()
    warm = w.wander(3000.0, 0.03)
    given, load, contact, slip, late = current.copy(), np.zeros(w.rows), np.ones(w.rows), np.zeros(w.rows), 0.0
    if w.case == "current limit":
        given = np.minimum(current, w.fault.uniform(0.5, 0.9))
    elif w.case == "ammeter off":
        given = current + w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.15, 0.3)
    elif w.case == "cell aged":
        ohms *= float(w.fault.uniform(1.5, 2.2))
    elif w.case == "loose contact":
        contact += w.fault.uniform(0.8, 2.0) * w.episodes((1, 4), (15, 50))
    elif w.case == "hidden load":
        load = w.fault.uniform(0.3, 0.6) * w.episodes((1, 3), (40, 100))
    elif w.case == "voltmeter slips":
        slip[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(0.04, 0.12)
    elif w.case == "voltmeter slow":
        late = float(w.fault.uniform(30.0, 90.0))

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        inside = given[k] - load[k]
        return inside / (3600 * capacity), (slow_ohms * inside - x[1]) / relaxes

    x = integrate(rate, (0.5, 0.0), w, 4)
    charge = x[:, 0]
    at_rest = 3.3 + 0.8 * charge + bend * np.tanh((charge - 0.8) / 0.08) + bend * np.tanh((charge - 0.2) / 0.08)
    volts = at_rest + x[:, 1] + ohms * contact * (1 + warm) * (given - load)
    return {"current_A": current, "volts_V": (lagged(volts, late, w.dt) if late else volts) + slip}


PROCESS = Process(
    "battery",
    DT,
    (500, 1400),
    make_model,
    plant,
    {"volts_V": 0.002},
    {
        NOTHING: Case(()),
        "current limit": Case(tuple(("charger", d) for d in (*ENDS, "current"))),
        "ammeter off": Case((("charger", SHIFT), ("load", SHIFT), ("charger", "own_value"))),
        "cell aged": Case((("resistance", SHIFT),), "reference"),
        "loose contact": Case((("resistance", EVENT),)),
        "hidden load": Case((("load", EVENT), ("charger", EVENT))),
        "voltmeter slips": Case((("voltmeter", EVENT), ("at_rest", EVENT)), "alone"),
        "voltmeter slow": Case((("voltmeter", "lag"), ("voltmeter", "delay"))),
    },
    {
        ("at_rest", "charge"): "the voltage at rest is no straight line",
        ("at_rest", "current"): "the cell relaxes",
        ("resistance", "current"): "the cell relaxes",
    },
)
