"""A mixing tank whose feed nobody analyses. The plant mixes imperfectly, and its analyser is slow and late."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Model, Quantity, Scope
from benchmarks.other_processes.process import ENDS, EVENT, MOVES, NOTHING, SHIFT, Case, Pair, Process, estimated
from benchmarks.other_processes.world import Columns, World, dragged, integrate, lagged

DT = 30.0


def make_model() -> Model:
    """One stirred tank of constant volume with two feeds."""

    def equations(m: Scope) -> None:
        strength = m.state("strength")
        feed = m.site("feed_strength", m.parameter("feed_strength"), "feed", unit="g/L")
        acid = m.site("dosing_pump", m.input("dose"), "actuator", unit="L/s")
        flow = m.site("feed_flow", m.input("feed"), "flow", unit="L/s")
        volume = m.site("volume", m.parameter("volume"), unit="L")
        added = flow * feed + acid * m.parameter("stock")
        m.derivative("strength", (added - (flow + acid) * strength) / volume)
        m.output("strength", m.site("analyser", strength, "sensor", "offset", unit="g/L"))

    return Model(
        name="mixing tank",
        states=(Quantity("strength", "g/L", "", 0.0, 500.0, scale=5.0),),
        inputs=(Quantity("feed", "L/s", "", 0.0, 20.0), Quantity("dose", "L/s", "", 0.0, 2.0)),
        parameters=(
            estimated("feed_strength", 10.0, "g/L"),
            estimated("stock", 200.0, "g/L"),
            estimated("volume", 1000.0, "L"),
        ),
        outputs=(Quantity("strength", "g/L", "", scale=5.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"strength": 25.0},
    )


def plant(w: World) -> Columns:
    """A well-mixed part and a corner; the feed wanders; the dose is controlled or not."""
    strength, stock, volume = w.off(12.0), w.off(220.0, 0.03), w.off(1200.0)
    corner, exchange = 0.2 * volume, w.extra(1.5, 3.0)
    feed, dose = w.hold((3.0, 6.0), 20, 80), w.hold((0.15, 0.55), 15, 60)
    target = w.hold((18.0, 30.0), 60, 150)
    wanders = w.wander(3600.0, 0.5)
    at, band, late, dead, most = w.onset(), 0.0, 0.0, 0, 9.0
    step, gain, pumped = np.zeros(w.rows), 1.0, 1.0
    if w.case == "wandering feed":
        wanders = 5 * wanders
    elif w.case == "feed changes":
        step[at:] = w.fault.choice([-1.0, 1.0]) * w.fault.uniform(3.0, 6.0)
    elif w.case == "analyser slow":
        late = float(w.fault.uniform(180.0, 400.0))
    elif w.case == "analyser late":
        dead = int(w.fault.integers(4, 10))
    elif w.case == "analyser off":
        gain = float(w.fault.choice([0.8, 1.25]))
    elif w.case == "pump sticks":
        band = float(w.fault.uniform(0.05, 0.1))
    elif w.case == "pump limit":
        most = float(w.fault.uniform(0.3, 0.4))
    elif w.case == "pump worn":
        pumped = float(w.fault.uniform(0.6, 0.8))
    given = dragged(dose, band)

    def control(k: int, x: tuple[float, ...]) -> None:
        error = float(target[k] - x[0])
        dose[k] = float(np.clip(0.3 + 0.02 * error + 0.02 / 900.0 * x[2], 0.02, 1.0))
        given[k] = min(max(given[k - 1], dose[k] - band), dose[k] + band)

    def rate(k: int, x: tuple[float, ...]) -> tuple[float, ...]:
        main, aside, _ = x
        acid = pumped * min(given[k], most)
        added = feed[k] * (strength + wanders[k] + step[k]) + acid * stock
        free = 0.02 < dose[k] < 1.0
        main_volume = volume - (corner if exchange else 0.0)
        return (
            (added - (feed[k] + acid) * main + exchange * (aside - main)) / main_volume,
            exchange * (main - aside) / corner,
            (target[k] - main) * free,
        )

    x = integrate(rate, (25.0, 25.0, 0.0), w, 6, before=control if w.feedback else None)[:, 0]
    shown = lagged(x, late, w.dt) if late else x
    shown = np.concatenate([np.full(dead, shown[0]), shown[: w.rows - dead]])
    return {"feed_L_s": feed, "dose_L_s": dose, "strength_g_L": gain * shown}


LATE: tuple[Pair, ...] = (("analyser", "lag"), ("analyser", "delay"))
PROCESS = Process(
    "mixing_tank",
    DT,
    (600, 1500),
    make_model,
    plant,
    {"strength_g_L": 0.15},
    {
        NOTHING: Case(()),
        "wandering feed": Case((), "alone", tolerated=(("feed_strength", EVENT),)),
        "feed changes": Case((("feed_strength", EVENT),)),
        "analyser slow": Case(LATE),
        "analyser late": Case(LATE),
        "analyser off": Case((("analyser", "own_value"), ("analyser", SHIFT)), "reference"),
        "pump sticks": Case((("dosing_pump", MOVES), ("dosing_pump", "own_value"))),
        "pump limit": Case(tuple(("dosing_pump", d) for d in (*ENDS, "dose"))),
        "pump worn": Case((("dosing_pump", SHIFT), ("dosing_pump", "own_value")), "reference"),
    },
    {
        ("analyser", "lag"): "a corner of the tank mixes slowly",
        ("analyser", "delay"): "a corner of the tank mixes slowly",
        ("dosing_pump", "delay"): "a corner of the tank mixes slowly",
        ("feed_flow", "strength"): "the corner is a second store",
    },
    True,
)
