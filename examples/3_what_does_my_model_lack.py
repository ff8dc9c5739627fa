# %% [markdown]
# # 3. What does my model lack?
#
# A model fits a record badly. Which physical effect is missing, where does it act, and what drives it? `af.discover`
# answers with a verdict: a name, a class of a few names, a curve without a name, or that it can not be told.
#
# The plant here is two tanks, one above the other, with a pump. The model is the shipped `cascaded-tanks`. It takes the
# pump for a linear one; the pump of the plant delivers more than its share at a high voltage.

# %%
import os
from pathlib import Path

import numpy as np
import pandas as pd

import adaptive_flot as af

ROWS = int(os.environ.get("EXAMPLE_ROWS", "600"))
OUT = Path("results/examples/what_does_my_model_lack")
OUT.mkdir(parents=True, exist_ok=True)


# %% [markdown]
# The record of the plant, made without any code of this project: Euler steps of the balance of each tank.


# %%
def plant(voltage: np.ndarray, interval: float = 4.0, steps: int = 20) -> np.ndarray:
    """Level of the lower tank [V] at the end of each interval (N,), with the noise of its sensor."""
    upper, lower, levels = 5.0, 5.0, []
    for u in voltage:
        pumped = 0.05 * u * (u / 3.0) ** 0.35  # the model: 0.05 u
        for _ in range(steps):
            out = 0.06 * np.sqrt(upper)
            upper += interval / steps * (pumped - out)
            lower += interval / steps * (out - 0.055 * np.sqrt(lower))
        levels.append(lower)
    return np.array(levels) + np.random.default_rng(1).normal(0.0, 0.01, len(voltage))


levels = np.random.default_rng(7).uniform(1.8, 3.6, ROWS // 15 + 1)
voltage = np.repeat(levels, 15)[:ROWS]
record = pd.DataFrame({"time_s": 4.0 * np.arange(1, ROWS + 1), "pump_voltage_V": voltage, "level_V": plant(voltage)})

# %% [markdown]
# A part of the record estimates, a part confirms, and a part that chose and fitted nothing reports the error before and
# after.

# %%
found = af.discover("cascaded-tanks", record)
print(found)

# %% [markdown]
# The verdict names the site and the driver: the flow of the pump depends on its voltage in another way than the model
# says. The exponent of the fitted law is that of the plant, 0.35, within its interval.

# %%
print(found.effects.to_string(index=False))
for kind in found.kinds:
    found.plot(kind).savefig(OUT / f"{kind}.png")

# %% [markdown]
# The extended model is a model like any other. Saved, it can be named in `af.run`, `af.estimate` and the command line.

# %%
path = found.save(OUT / "tanks_with_their_pump.yaml")
print(path.read_text())
print(f"Report: {found.report(OUT / 'report.html')}")
