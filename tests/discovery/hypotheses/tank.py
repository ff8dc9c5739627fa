"""A heated tank of one balance, and noisy records of it with things that its model does not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from adaptive_flot.greybox import Dataset, Effect, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator

DT, ROWS, NOISE = 20.0, 500, 0.05


def tank(zero: float = 0.0) -> Model:
    """A heated tank whose temperature is given above `zero` kelvin."""

    def equations(m: Scope) -> None:
        temperature = m.state("temperature")
        heating = m.site("heater", m.parameter("efficiency") * m.input("power"), "actuator", unit="W")
        loss = m.site("heat_loss", m.parameter("loss") * (temperature - (293.0 - zero)), "flow", unit="W")
        m.derivative("temperature", (heating - loss) / 1.0e5)
        m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))

    return Model(
        name="tank",
        states=(Quantity("temperature", "K", "", 200.0 - zero, 400.0 - zero, scale=10.0),),
        inputs=(Quantity("power", "W", "", 0.0, 1.0e4),),
        parameters=(
            Parameter("efficiency", 0.8, "-", "", lower=0.3, upper=1.5, scale=0.1, role="estimated"),
            Parameter("loss", 60.0, "W/K", "", lower=1.0, upper=1.0e3, scale=10.0, role="estimated"),
        ),
        outputs=(Quantity("temperature", "K", "", scale=10.0),),
        equations=equations,
        max_step_s=20.0,
        initial_guess={"temperature": 300.0 - zero},
        starts_steady=False,
    )


def record(
    name: str, seed: int, *effects: Effect, zero: float = 0.0, start: float = 300.0, rests: float = 0.0
) -> Dataset:
    """A noisy record of the tank with effects that the model does not have; the heater rests for a share of it."""
    rng = np.random.default_rng(seed)
    levels = rng.choice([0.0, 800.0, 1600.0, 2400.0], ROWS // 25)
    levels = np.where(rng.random(len(levels)) < rests, 0.0, levels) if rests else levels
    power: FloatArray = np.repeat(levels, 25).astype(np.float64)
    plant = tank().with_parameters({"efficiency": 0.9, "loss": 80.0}).with_effects(effects)
    data = Dataset(name, DT * np.arange(ROWS, dtype=np.float64), DT, power[:, None], np.zeros((ROWS, 1)))
    x0 = np.concatenate([[start], np.ones(len(plant.states) - 1)])
    true = RecordSimulator(plant, DT).outputs(data, x0, plant.parameter_values)
    return replace(data, outputs=true - zero + NOISE * rng.normal(size=(ROWS, 1)))


STUCK = Effect("heater", "own_value", "stuck", {"amplitude": 1.0, "level": 1200.0})
LEAKS = Effect("heater", "own_value", "leak", {"amplitude": 1.0, "level": 700.0}, {"width": 1.0})
COLDER = Effect("thermometer", "constant", "shift", {"amplitude": -3.0}, mode="offset")
DRAUGHT = Effect("heat_loss", "constant", "shift", {"amplitude": 0.5}, mode="factor")


def make_model() -> Model:
    """Return the tank in kelvin, as the command line asks for it."""
    return tank()


def table(data: Dataset) -> pd.DataFrame:
    """The record as a table with the model's columns."""
    return pd.DataFrame({"time_s": data.time, "power_W": data.inputs[:, 0], "temperature_K": data.outputs[:, 0]})
