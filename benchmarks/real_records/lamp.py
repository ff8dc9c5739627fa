"""A lamp over a steel plate (DaISy 99-001): a negative example, where no one knows what is missing.

Dullerud & Smith, *Int. J. Robust Nonlinear Control* 6 (1996) 1065.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

TRUTH = ("not known", "no name is right")


def make_model() -> Model:
    """A plate with one heat store, and a lamp with a lag (degC)."""

    def equations(m: Scope) -> None:
        lamp, plate = m.state("lamp"), m.state("plate")
        power = m.site("lamp_power", m.parameter("gain") * m.input("voltage") ** 2, "actuator", unit="K/s")
        loss = m.site("loss", m.parameter("loss") * (plate - m.parameter("ambient")), "flow", unit="K/s")
        m.derivative("lamp", (power - lamp) / m.parameter("lag"))
        m.derivative("plate", lamp - loss)
        m.output("plate", m.site("thermocouple", plate, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str, lower: float, upper: float, scale: float) -> Parameter:
        return Parameter(name, value, unit, "", lower=lower, upper=upper, scale=scale, role="estimated")

    return Model(
        name="lamp over a plate",
        states=(Quantity("lamp", "K/s", "", scale=0.3), Quantity("plate", "degC", "", -50.0, 500.0, scale=10.0)),
        inputs=(Quantity("voltage", "V", "", 0.0, 20.0),),
        parameters=(
            constant("gain", 0.02, "K/(s V2)", 1e-4, 1.0, 0.005),
            constant("loss", 0.01, "1/s", 1e-4, 1.0, 0.003),
            constant("ambient", 30.0, "degC", -20.0, 120.0, 10.0),
            constant("lag", 10.0, "s", 1.0, 200.0, 5.0),
        ),
        outputs=(Quantity("plate", "degC", "", scale=10.0),),
        equations=equations,
        max_step_s=2.0,
        starts_steady=False,
        initial_guess={"lamp": 0.7, "plate": 129.0},
    )


def record(folder: Path) -> Dataset:
    """All 801 rows of 2 s."""
    table = pd.read_csv(folder / "lamp-heating" / "data.csv")
    time, voltage, plate = (table[c].to_numpy(float) for c in ("t_s", "u_V", "y_degC"))
    return Dataset("lamp", time, 2.0, voltage[:, None], plate[:, None])
