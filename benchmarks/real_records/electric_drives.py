"""Two coupled electric drives: five records of one plant, whose pulse counter does not see the sign of the speed.

Wigren & Schoukens, technical report 2017-024, Uppsala University.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

TRUTH = ("tachometer", "absolute value")
INTERVAL = 0.02
_PAIRS = (("DATAPRBS.csv", "u1", "z1"), ("DATAPRBS.csv", "u2", "z2"), ("DATAPRBS.csv", "u3", "z3"),
          ("DATAUNIF.csv", "u11", "z11"), ("DATAUNIF.csv", "u12", "z12"))  # fmt: skip


def make_model() -> Model:
    """The third-order linear model of the report, without the absolute value."""

    def equations(m: Scope) -> None:
        lag, speed, change = m.state("lag"), m.state("speed"), m.state("change")
        w, a = m.parameter("w0"), m.parameter("a")
        volts = m.site("motors", m.parameter("k") * m.input("voltage"), "actuator", unit="V")
        m.derivative("lag", a * (volts - lag))
        m.derivative("speed", change)
        m.derivative("change", w**2 * (lag - speed) - 2 * m.parameter("xi") * w * change)
        m.output("shown", m.site("tachometer", speed, "sensor", "offset", unit="V"))

    def constant(name: str, value: float, unit: str, lower: float, upper: float, scale: float) -> Parameter:
        return Parameter(name, value, unit, "", lower=lower, upper=upper, scale=scale, role="estimated")

    return Model(
        name="electric drives",
        states=(
            Quantity("lag", "V", "", scale=1.0),
            Quantity("speed", "V", "", scale=1.0),
            Quantity("change", "V/s", "", scale=5.0),
        ),
        inputs=(Quantity("voltage", "V", ""),),
        parameters=(
            constant("k", 0.7, "-", 0.05, 5.0, 0.2),
            constant("w0", 15.0, "1/s", 3.0, 60.0, 4.0),
            constant("xi", 0.3, "-", 0.02, 2.0, 0.1),
            constant("a", 5.0, "1/s", 0.3, 60.0, 2.0),
        ),
        outputs=(Quantity("shown", "V", "", scale=1.0),),
        equations=equations,
        max_step_s=INTERVAL,
        starts_steady=False,
        initial_guess={"lag": 0.0, "speed": 0.0, "change": 0.0},
    )


def records(folder: Path) -> list[Dataset]:
    """The five records, 500 rows of 20 ms each."""
    each = []
    for file, u, z in _PAIRS:
        table = pd.read_csv(folder / "coupled-electric-drives" / file, index_col=False)
        rows = len(table)
        inputs, outputs = (table[[c]].to_numpy(float) for c in (u, z))
        each.append(Dataset(z, INTERVAL * np.arange(rows, dtype=np.float64), INTERVAL, inputs, outputs))
    return each
