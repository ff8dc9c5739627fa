"""A tank that a pump fills and a gauge shows, late: the user's model, and an independent simulation."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

DT, TIME, LATE = 1.0, 40.0, 6.0


def model() -> Model:
    """x' = (pump - x) / T, shown by a gauge; T is known to be the slower one of the two lags in a row."""

    def equations(m: Scope) -> None:
        x = m.state("x")
        m.derivative("x", (m.site("pump", m.input("u"), "actuator") - x) / m.parameter("time"))
        m.output("y", m.site("gauge", x, "sensor", "offset"))

    return Model(
        name="tank",
        states=(Quantity("x", "", "", scale=1.0),),
        inputs=(Quantity("u", "", ""),),
        parameters=(Parameter("time", TIME, "s", "", lower=20.0, upper=1000.0, scale=10.0, role="estimated"),),
        outputs=(Quantity("y", "", "", scale=1.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
    )


def record(seed: int, rows: int, wander: float, dead_rows: int | None = None) -> Dataset:
    """The tank with so much noise on its balance [1/s^0.5], and a gauge that is late; Euler, twenty steps a row.

    The gauge is late by a lag, or shows what was there `dead_rows` rows earlier.
    """
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], rows // 20), 20)
    x, shown, held, y = 0.0, 0.0, [], []
    for k in range(rows):
        for _ in range(20):
            x += DT / 20 * (u[k] - x) / TIME + wander * np.sqrt(DT / 20) * rng.standard_normal()
            shown += DT / 20 * (x - shown) / LATE
        held.append(x)
        late = shown if dead_rows is None else held[max(len(held) - 1 - dead_rows, 0)]
        y.append(late + 0.01 * rng.standard_normal())
    return Dataset("tank", DT * np.arange(1.0, rows + 1), DT, u[:, None], np.array(y)[:, None])
