"""A steam heat exchanger (DaISy 97-002): a constant gain from flow to temperature, where the real one falls with flow.

Bittanti & Piroddi, *J. Franklin Inst.* 334B (1997) 135.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

TRUTH = ("heating or holdup", "depends on the flow")
FIRST, LAST = 200, 3000
"""Rows that are given to the search; the rest, the last quarter, is run on over."""


def make_model() -> Model:
    """One stirred cell: the outlet falls in proportion to the flow, with one time constant (degC)."""

    def equations(m: Scope) -> None:
        outlet, flow = m.state("outlet"), m.input("flow")
        gain = m.site("heating", m.parameter("gain"), unit="K")
        lag = m.site("residence_time", m.parameter("time_constant"), unit="s")
        m.derivative("outlet", (m.parameter("at_rest") - gain * flow - outlet) / lag)
        m.output("outlet", m.site("thermometer", outlet, "sensor", "offset", unit="K"))

    return Model(
        name="heat exchanger",
        states=(Quantity("outlet", "degC", "", 0.0, 200.0, scale=2.0),),
        inputs=(Quantity("flow", "-", "", 0.0, 1.0),),
        parameters=(
            Parameter("gain", 10.0, "K", "", lower=0.1, upper=100.0, scale=3.0, role="estimated"),
            Parameter("at_rest", 100.0, "degC", "", lower=50.0, upper=150.0, scale=3.0, role="estimated"),
            Parameter("time_constant", 30.0, "s", "", lower=2.0, upper=500.0, scale=10.0, role="estimated"),
        ),
        outputs=(Quantity("outlet", "degC", "", scale=2.0),),
        equations=equations,
        max_step_s=1.0,
        starts_steady=False,
        initial_guess={"outlet": 97.0},
    )


def record(folder: Path) -> Dataset:
    """All 4,000 rows of 1 s."""
    table = pd.read_csv(folder / "heat-exchanger" / "data.csv")
    time, flow, outlet = (table[c].to_numpy(float) for c in ("t_s", "q", "th_degC"))
    return Dataset("heat exchanger", time, 1.0, flow[:, None], outlet[:, None])
