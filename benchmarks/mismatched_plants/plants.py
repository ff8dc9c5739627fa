"""Plants that the model does not describe: other constants, an effect, a feed that wanders, a sensor with lag.

Each is a scenario like `closed_loop_drift`, n and C drifting as there, whose key `plant` says the rest. The feed flow
is measured, the feed grade is not. Some draws ask nothing of a controller, since the plant keeps the limit of the grade
whatever is done, or can not keep it. They are drawn again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.processes.flotation.cell_file import default_cell, save_cell
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.scenario.loading import find_scenario, load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario

CHANCE = "economic_mpc_chance"
"""The controller that backs off from the covariance of the estimate."""
TREE = "economic_mpc_tree"
"""The controller whose first move keeps the limits in nine scenarios."""
EARLY = "economic_mpc_early"
"""The same, with plans before their time where a limit is missed."""
LESS_CAREFUL = "economic_mpc_early_80"
"""The same, with scenarios that limits keep with probability 0.8 instead of 0.95."""
MODIFIERS = "economic_mpc_modifiers"
"""The controller that learns how outputs answer to its moves."""
FASTEST = "fastest"
"""No controller, but the soonest that the limit can be kept; see `fastest.py`."""
BASE, COUNT, FIRST_SEED = "closed_loop_drift", 30, 7300
WIDTHS = {
    "floatability.chalcopyrite": 0.2,
    "floatability.quartz": 0.2,
    "drag_coefficient": 0.2,
    "peclet": 0.2,
    "particle_diameter.chalcopyrite": 0.1,
    "particle_diameter.quartz": 0.1,
    "burst_b": 0.03,
    "solids_density": 0.05,
    "coalescence_rate": 0.2,
    "growth_exponent": 0.1,
}
"""Largest factor of each constant, less 1; five of them are drawn."""
EFFECTS: tuple[tuple[str, str, tuple[float, str], float], ...] = (
    ("bubble_size", "air_flow", (1.5e-3, "m3/s"), 0.4),
    ("coalescence", "air_flow", (1.5e-3, "m3/s"), 0.4),
    ("entrainment", "feed_flow", (1.67e-4, "m3/s"), 0.5),
    ("froth_recovery", "froth_depth", (0.1, "m"), 0.3),
)
"""Site, driver, reference and largest exponent of a power law; one is drawn."""
LEAST_SPAN = 0.01
"""The grades that the plant can be held at must reach so far beyond the limit, above and below."""


def plant(number: int, folder: Path) -> Scenario:
    """The scenario of a plant, from 0 to 29, written into a folder and read."""
    for attempt in range(100):
        generator = np.random.default_rng([FIRST_SEED + number, attempt])
        path = _written(number, generator, folder)
        try:
            scenario = load_scenario(path)
            if _asks_something(scenario):
                return scenario
        except AdaptiveFlotError:  # a range of the model is left: another draw
            continue
    raise AssertionError(f"plant {number}: no draw of 100 can be used")


def _written(number: int, generator: np.random.Generator, folder: Path) -> Path:
    cell, name = default_cell(), f"plant_{number:02d}"
    chosen = generator.choice(len(WIDTHS), 5, replace=False)
    constants = [list(WIDTHS)[i] for i in sorted(chosen)]
    values = {k: cell.value(k) * float(1 + WIDTHS[k] * generator.uniform(-1, 1)) for k in constants}
    save_cell(cell_file(), values, "benchmark: other than the model's", folder / f"{name}_cell.yaml")
    site, driver, (reference, unit), largest = EFFECTS[generator.integers(len(EFFECTS))]
    power = {
        "site": site,
        "driver": driver,
        "form": "power",
        "coefficients": {"exponent": float(largest * generator.uniform(-1, 1))},
        "settings": {"reference": {"value": reference, "unit": unit}},
    }
    lag = {
        "site": "grade_sensor",
        "driver": "lag",
        "form": "lag",
        "coefficients": {
            "amplitude": 1.0,
            "time_constant": {"value": float(generator.uniform(5, 40)), "unit": "s"},
        },
        "settings": {"scale": 0.2},
    }
    wander = {"share": float(generator.uniform(0.03, 0.1)), "correlation_s": float(generator.uniform(300, 1800))}
    grade = {"share": float(generator.uniform(0.03, 0.15)), "correlation_s": float(generator.uniform(600, 3600))}
    content: dict[str, Any] = yaml.safe_load(find_scenario(BASE).read_text(encoding="utf-8"))
    content["description"] = f"Mismatched plant {number}"
    chance = {"solver": "fatrop", "limit_probability": 0.95}
    content["controllers"][CHANCE] = {"use": "economic_mpc", "options": chance}
    content["controllers"][TREE] = {"use": "economic_mpc", "options": {"solver": "fatrop", "scenarios": 9}}
    early = {"solver": "fatrop", "scenarios": 9, "early_plans": True}
    content["controllers"][EARLY] = {"use": "economic_mpc", "options": early}
    content["controllers"][LESS_CAREFUL] = {"use": "economic_mpc", "options": early | {"limit_probability": 0.8}}
    content["controllers"][MODIFIERS] = {"use": "economic_mpc", "options": {"solver": "fatrop", "modifiers": True}}
    content["controllers"][FASTEST] = {"use": "benchmarks.mismatched_plants.fastest:Fastest"}
    content["disturbances"] = {
        "feed_flow_m3_s": {"noise_std": 8.0e-7},
        "feed_concentration.chalcopyrite": {"measured": False},
    }
    content["plant"] = {
        "cell": f"{name}_cell.yaml",
        "effects": [power, lag],
        "feed_walk": {"feed_flow_m3_s": wander, "feed_concentration.chalcopyrite": grade},
    }
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def _asks_something(scenario: Scenario) -> bool:
    """Whether the limit of the grade lies well inside the steady grades of the plant, at three by three inputs."""
    limits, model = scenario.limits, scenario.plant_model
    assert limits is not None
    least = limits.outputs["concentrate_grade"][0]
    row = [scenario.file.inputs[q.column].values(scenario.starts[:1], 1)[0] for q in model.inputs]
    grades = []
    for air in np.linspace(*limits.inputs["air_flow"], 3):
        for level in np.linspace(*limits.inputs["level_setpoint"], 3):
            inputs = np.array(row)
            inputs[model.index("inputs", "air_flow")] = air
            inputs[model.index("inputs", "level_setpoint")] = level
            found = steady_state(model, inputs)
            outputs = model.ode(0.0, found.state, inputs, model.parameter_values)[1]
            grades.append(float(outputs[model.index("outputs", "concentrate_grade")]))
    return min(grades) < least - LEAST_SPAN and max(grades) > least + LEAST_SPAN
