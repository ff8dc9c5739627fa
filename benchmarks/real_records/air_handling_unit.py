"""An air-handling unit with imposed faults: the model, the days, and what was done to the unit on each.

Granderson et al., *Scientific Data* 7 (2020) 65. The truth serves to judge by, and for nothing else.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope

REFERENCE = "04-01"
TRUTH = {
    "03-11": ("cooling_valve", "stuck at 0"),
    "03-12": ("cooling_valve", "stuck at 1"),
    "03-15": ("cooling_valve", "leaks 5 %"),
    "03-16": ("cooling_valve", "leaks 50 %"),
    "03-18": ("outdoor_damper", "stuck at 1"),
    "03-19": ("outdoor_damper", "stuck at 0.5"),
    "03-20": ("outdoor_damper", "leaks 20 %"),
    "03-21": ("outdoor_damper", "leaks 50 %"),
    "03-22": ("heating_valve", "leaks 5 %"),
    "03-23": ("heating_valve", "leaks 40 %"),
    "03-24": ("heating_valve", "stuck at 0"),
    "03-25": ("heating_valve", "stuck at 1"),
    "03-26": ("heating_valve", "stuck at 0.5"),
    "03-31": ("cooling_valve", "stuck at 0.5"),
}
"""Faulted part and fault, by day."""
SHOWS = tuple(day for day in TRUTH if day not in ("03-15", "03-20", "03-21", "03-22"))
"""Days whose fault stands out of the noise: the others are leaks of 5 % and of the damper."""
SAME_PART = {"heating_coil": "heating_valve", "cooling_coil": "cooling_valve"}
"""A coil that gives nothing and its valve that stays shut are the same to these sensors."""
HOT_WATER, CHILLED_WATER = 60.0, 6.7
"""Usual design temperatures of the water [degC] (140 and 44 degF); those of the unit were not recorded."""
_COLUMNS = {
    "outdoor": "outdoor_air_temperature_degF",
    "return_air": "return_air_temperature_degF",
    "outdoor_damper": "outdoor_damper_1",
    "heating_valve": "heating_valve_1",
    "cooling_valve": "cooling_valve_1",
}


def make_model() -> Model:
    """Mixing of outdoor and return air, two coils with a lag each, a sensor behind each (degC)."""

    def equations(m: Scope) -> None:
        mixed, seen, heat, cool, supply = (m.state(n) for n in ("mixed", "mixed_seen", "heat", "cool", "supply"))
        damper, hot, cold = (
            m.site(n, m.input(n), "actuator", "offset") for n in ("outdoor_damper", "heating_valve", "cooling_valve")
        )
        share = m.parameter("a0") + m.parameter("a1") * damper
        blend = m.input("return_air") + share * (m.input("outdoor") - m.input("return_air"))
        heating = m.site("heating_coil", m.parameter("kh") * ca.power(ca.fmax(hot, 1e-6), m.parameter("eh")))
        cooling = m.site("cooling_coil", m.parameter("kc") * ca.power(ca.fmax(cold, 1e-6), m.parameter("ec")))
        inlet = mixed + m.parameter("fan")
        m.derivative("mixed", (blend - mixed) / m.parameter("tm"))
        m.derivative("mixed_seen", (mixed - seen) / 60.0)
        m.derivative("heat", (heating * (HOT_WATER - inlet) - heat) / m.parameter("th"))
        m.derivative("cool", (cooling * (inlet - CHILLED_WATER) - cool) / m.parameter("tc"))
        m.derivative("supply", (inlet + heat - cool - supply) / 60.0)
        m.output("mixed", m.site("mixed_sensor", mixed, "sensor", "offset", unit="K"))
        m.output("supply", m.site("supply_sensor", supply, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str, lower: float, upper: float, scale: float) -> Parameter:
        return Parameter(name, value, unit, "", lower=lower, upper=upper, scale=scale, role="estimated")

    constants = (
        constant("a0", 0.05, "-", 0.0, 1.0, 0.1),
        constant("a1", 0.6, "-", 0.0, 2.0, 0.2),
        constant("kh", 0.5, "-", 0.2, 1.0, 0.2),
        constant("eh", 1.0, "-", 0.2, 5.0, 0.3),
        constant("kc", 0.5, "-", 0.2, 1.0, 0.2),
        constant("ec", 1.0, "-", 0.2, 5.0, 0.3),
        constant("th", 120.0, "s", 20.0, 1200.0, 60.0),
        constant("tc", 120.0, "s", 20.0, 1200.0, 60.0),
        constant("tm", 60.0, "s", 20.0, 1200.0, 60.0),
        constant("fan", 0.5, "K", -5.0, 5.0, 0.5),
    )
    names = ("mixed", "mixed_seen", "heat", "cool", "supply")
    return Model(
        name="air handling unit",
        states=tuple(Quantity(n, "K", "", -100.0, 200.0, 5.0) for n in names),
        inputs=(
            *(Quantity(n, "degC", "") for n in ("outdoor", "return_air")),
            *(Quantity(n, "-", "") for n in ("outdoor_damper", "heating_valve", "cooling_valve")),
        ),
        parameters=constants,
        outputs=tuple(Quantity(n, "degC", "", scale=5.0) for n in ("mixed", "supply")),
        equations=equations,
        max_step_s=20.0,
        starts_steady=False,
        initial_guess={"mixed": 22.0, "mixed_seen": 22.0, "heat": 0.0, "cool": 0.0, "supply": 22.0},
    )


def days(folder: Path) -> dict[str, Dataset]:
    """Every day of the published file (1440 rows), in degC, by month and day."""
    table = pd.read_csv(folder / "air-handling-unit" / "days.csv", parse_dates=["timestamp"])
    each = {}
    for day, rows in table.groupby(table["timestamp"].dt.strftime("%m-%d")):
        inputs = np.column_stack([_in_celsius(rows[c]) for c in _COLUMNS.values()])
        outputs = np.column_stack([_in_celsius(rows[f"{n}_air_temperature_degF"]) for n in ("mixed", "supply")])
        first = np.array([outputs[0, 0], outputs[0, 0], 0.0, 0.0, outputs[0, 1]])
        each[str(day)] = Dataset(
            str(day), 60.0 * np.arange(len(rows), dtype=np.float64), 60.0, inputs, outputs, {}, first
        )
    return each


def _in_celsius(column: pd.Series[float]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    values = pd.to_numeric(column, errors="coerce").to_numpy(float)
    return (values - 32.0) / 1.8 if str(column.name).endswith("degF") else values
