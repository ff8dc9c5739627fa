# %% [markdown]
# # 5. An economic controller on another process
#
# The economic MPC knows nothing of flotation. What is earned is an object of the user's, and what is moved and limited
# are names of the model. Here it runs two water tanks, one above the other, whose lower hole clogs.
#
# What leaves the lower tank is sold; power for the pump is bought. The level must stay below 8 V, where water would
# spill.

# %%
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.charts.plotdata import Panel, Role, Trace
from adaptive_flot.contracts import ControllerSetup, Limits, OperatingPoint, Prior, Setup
from adaptive_flot.greybox import steady_state
from adaptive_flot.processes.registry import make_model
from adaptive_flot.report.kit.figures import time_figure
from adaptive_flot.runner.loop.loop import run_loop
from adaptive_flot.runner.plants.plant import SimulatedPlant
from controllers.economic_mpc import EconomicMpc
from controllers.hold import Hold
from estimators.ekf import Ekf

ROWS = int(os.environ.get("EXAMPLE_ROWS", "600"))
OUT = Path("results/examples/an_economic_controller")
OUT.mkdir(parents=True, exist_ok=True)
DT = 4.0


# %% [markdown]
# Rates are read by name from an operating point. The same lines serve the optimiser, with symbols, and the account
# below, with arrays.


# %%
class Water:
    """Water sold by the flow out of the lower tank; power by the cube of the pump's voltage."""

    terms = ("sold", "power")
    typical_rate = 0.1

    def prices(self) -> Sequence[float]:
        """Per V of level that flows out [cu/V], and per V3 s of pumping [cu/(V3 s)]."""
        return [1.0, 1.0e-3]

    def rates(self, point: OperatingPoint, prices: Any) -> Mapping[str, Any]:
        """Rate of each term [cu/s]."""
        out = point.parameter("lower_outflow") * point.output("level") ** 0.5
        return {"sold": prices[0] * out, "power": -prices[1] * point.input("pump_voltage") ** 3}


# %% [markdown]
# The plant: the hole of the lower tank closes by 40 % over the run, and its sensor has a noise of 0.02 V. The estimator
# follows the outflow coefficient from the measured level; the controller reads the newest estimate.

# %%
model = make_model("cascaded-tanks")
limits = Limits(
    outputs={"level": (0.0, 8.0)}, inputs={"pump_voltage": (0.5, 5.0)}, moves={"pump_voltage": 0.5}, states={}
)
start = np.array([2.5])
setup = Setup(model, DT, ("lower_outflow",), ("level",))
x0 = steady_state(model, start).state
parameters = np.tile(model.parameter_values, (ROWS, 1))
parameters[:, model.index("parameters", "lower_outflow")] *= np.linspace(1.0, 0.6, ROWS)
noise = np.random.default_rng(1).normal(0.0, 0.02, (ROWS, 1))
nominal = model.parameter_values[model.indices("parameters", setup.parameters)]
prior = Prior(0.0, x0, nominal, np.diag((0.05 * nominal) ** 2), np.array([0.02]))


def run(controller: Any) -> pd.DataFrame:
    """One run: time, pump voltage, true level, estimate of the outflow coefficient, and what was earned."""
    plant = SimulatedPlant(model, DT, x0, parameters, noise)
    steps = run_loop(plant, Ekf(setup), controller, ROWS, initial_intervals=0, make_prior=lambda _: prior)
    inputs = np.array([s.plant.inputs for s in steps]).T
    outputs = np.array([s.plant.outputs for s in steps]).T
    point = OperatingPoint(model, None, inputs, outputs, parameters.T)
    earned = Water().rates(point, Water().prices())
    return pd.DataFrame(
        {
            "time_s": DT * np.arange(1, ROWS + 1),
            "pump_voltage_V": inputs[0],
            "level_V": outputs[0],
            "estimate": [s.estimate.parameters[0] for s in steps if s.estimate is not None],
            "truth": parameters[:, model.index("parameters", "lower_outflow")],
            **{term: DT * np.asarray(rate) for term, rate in earned.items()},
            "decided_by": [s.decision.decided_by for s in steps],
        }
    )


def told(voltage: float) -> ControllerSetup:
    """What a controller is built for: a pump voltage to start from, the limits and the economics."""
    return ControllerSetup(model, DT, np.full((ROWS, 1), voltage), setup.parameters, limits, Water())


results = {
    "hold 2.5 V": run(Hold(told(2.5))),
    "hold 1.65 V": run(Hold(told(1.65))),
    "economic_mpc": run(EconomicMpc(told(2.5), horizon=10, move_s=20.0, backoff=0.05)),
}

# %% [markdown]
# Held at the voltage of the start, the level is over its limit for most of the run, where the model no longer holds. A
# voltage that is low enough for the end of the run is safe, and earns less all the time.
#
# The controller pumps as much as the limit allows at each time. It follows the hole by the estimate, never leaves the
# limit, and earns more than the safe voltage.

# %%
rows = [
    {
        "controller": name,
        "sold": table["sold"].sum(),
        "power": table["power"].sum(),
        "value": (table["sold"] + table["power"]).sum(),
        "highest level [V]": table["level_V"].max(),
        "share of time over the limit [%]": 100 * (table["level_V"] > 8.0).mean(),
    }
    for name, table in results.items()
]
summary = pd.DataFrame(rows)
print(summary.round(2).to_string(index=False))
mpc = results["economic_mpc"]["pump_voltage_V"]
print(f"economic_mpc: pump at most {mpc.max():.2f} V, at the end {mpc.iloc[-1]:.2f} V")


# %%
def panel(label: str, unit: str, column: str, **options: Any) -> Panel:
    """One column of all runs over time."""
    traces = [
        Trace(name, table["time_s"].to_numpy(), table[column].to_numpy(), Role.ESTIMATE, j)
        for j, (name, table) in enumerate(results.items())
    ]
    return Panel(label, unit, tuple(traces), **options)


panels = [
    panel("pump voltage", "V", "pump_voltage_V"),
    panel("level", "V", "level_V", limits=(8.0,)),
    panel("lower outflow, estimated", "V^0.5/s", "estimate"),
]
time_figure(panels).savefig(OUT / "tanks.png")
