# %% [markdown]
# # 2. A model of one's own
#
# A tank of water with a heater, in a room with a fan. A model is a list of named quantities with units, and one
# function that writes the equations between them. Nothing here is about flotation.

# %%
import os
from pathlib import Path

import numpy as np
import pandas as pd

import adaptive_flot as af

ROWS = int(os.environ.get("EXAMPLE_ROWS", "600"))
OUT = Path("results/examples/a_model_of_ones_own")
OUT.mkdir(parents=True, exist_ok=True)


# %% [markdown]
# Each physical quantity in which something may be missing passes through a named *site*. A site changes nothing now; it
# is where a search may later attach an effect (see example 3).


# %%
def equations(m: af.Scope) -> None:
    """Heat balance of the water."""
    temperature = m.state("temperature")
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator", unit="W")
    loss = m.site("heat_loss", m.parameter("loss") * (temperature - 293.0), unit="W")
    m.derivative("temperature", (heating - loss) / 4.0e5)
    m.output("temperature", m.site("thermometer", temperature, "sensor", "offset", unit="K"))


def make_model() -> af.Model:
    """Names, units, ranges and scales; what is "estimated" is fitted to a record."""
    return af.Model(
        name="heated-tank",
        states=(af.Quantity("temperature", "K", "of the water", 273.0, 373.0, scale=10.0),),
        inputs=(
            af.Quantity("power", "W", "of the heater", 0.0, 1.0e4),
            af.Quantity("fan_speed", "1/s", "in the room", 0.0, 100.0),
        ),
        parameters=(
            af.Parameter("efficiency", 0.9, "-", "data sheet", lower=0.5, upper=1.0, scale=0.05),
            af.Parameter("loss", 80.0, "W/K", "a guess", lower=1.0, upper=1.0e3, scale=10.0, role="estimated"),
        ),
        outputs=(af.Quantity("temperature", "K", "of the water"),),
        equations=equations,
        max_step_s=60.0,
        initial_guess={"temperature": 310.0},
    )


# %% [markdown]
# A table of inputs goes in: `time_s`, and a column for each input with its unit in the name. The first row is the
# initial condition, here the steady state of its inputs.

# %%
time = 30.0 * np.arange(ROWS)
power = 1500.0 + 1000.0 * np.sign(np.sin(time / 1500.0))
inputs = pd.DataFrame({"time_s": time, "power_W": power, "fan_speed_1_s": 10.0})
model = make_model()
simulation = af.simulate(model, inputs)
print(simulation)
simulation.plot().savefig(OUT / "simulation.png")

# %% [markdown]
# Now the other way round. The record below is that of a tank which loses 65 W/K; its thermometer has a noise of 0.05 K.
# The first 60 % of it give the parameter, the rest tests it.

# %%
truth = af.simulate(model.with_parameters({"loss": 65.0}), inputs).table
noise = np.random.default_rng(1).normal(0.0, 0.05, ROWS)
record = truth.assign(temperature_K=truth["temperature_K"] + noise)
fit = af.estimate(model, record)  # nominal parameters, followed ones (adaptive_imm), fitted ones
print(fit)
fit.plot("outputs").savefig(OUT / "outputs.png")
fit.plot("parameters").savefig(OUT / "parameters.png")

# %% [markdown]
# The guess of 80 W/K is wrong by many standard deviations of the estimate. With the fitted value the free run misses
# the measurements by the noise of the thermometer and no more: nothing is left to explain.
#
# Put `equations` and `make_model` into a file `my_tank.py`, and the command line has the model too:
# `adaptive-flot estimate record.csv --model my_tank:make_model`.

# %%
loss = fit.parameters.set_index("label").loc["loss"]
print(f"loss = {loss['value']:.2f} +- {loss['std']:.2f} W/K")
print(f"Report: {fit.report(OUT / 'report.html')}")
