"""What modifiers of the MPC win where the slopes of its model are wrong: `python -m benchmarks.control.modifiers`.

It takes seven minutes a seed.

The scenario is `interior_optimum` with parameters that stay: the best point lies off the limit of the grade, so slopes
say where it is. The plant has a power law of the air flow that the model lacks. Recovery is measured, or not. The bound
is the best steady state of the plant, at the level where the loop holds it. The middle of the last hour's air flows is
compared with it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import find_scenario, load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.control.value_of_knowledge import HOUR, Steady

BASE, DURATION_S = "interior_optimum", 4 * 3600
EFFECTS: dict[str, tuple[str, float] | None] = {
    "none": None,
    "coalescence +": ("coalescence", 0.4),
    "coalescence -": ("coalescence", -0.4),
    "bubble size +": ("bubble_size", 0.4),
    "bubble size -": ("bubble_size", -0.4),
}
"""Site and exponent of a power law of the air flow; the largest of `benchmarks.mismatched_plants`."""
REFERENCE = {"value": 1.5e-3, "unit": "m3/s"}
CONTROLLERS = {"economic_mpc": False, "modifiers": True}
RECOVERY_NOISE = 5e-3


def written(effect: tuple[str, float] | None, recovery: bool, path: Path) -> Scenario:
    """The scenario with a plant of its own, written and read."""
    content: dict[str, Any] = yaml.safe_load(find_scenario(BASE).read_text(encoding="utf-8"))
    content |= {"duration_s": DURATION_S, "description": "Slopes of the model are wrong", "parameters": {}}
    content["controllers"] = {
        name: {"use": "economic_mpc", "options": {"solver": "fatrop", "horizon": 40, "modifiers": asked}}
        for name, asked in CONTROLLERS.items()
    }
    content["cases"] = [{"controller": name, "estimator": "adaptive_imm"} for name in CONTROLLERS]
    if recovery:
        content["measurements"]["recovery"] = {"noise_std": RECOVERY_NOISE}
    if effect is not None:
        site, exponent = effect
        power = {"site": site, "driver": "air_flow", "form": "power", "coefficients": {"exponent": exponent}}
        content["plant"] = {"effects": [power | {"settings": {"reference": REFERENCE}}]}
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return load_scenario(path)


def rested(scenario: Scenario, controller: str, seed: int) -> tuple[float, float]:
    """Air flow [m3/s] and level set-point [m] in the middle of the last hour's values."""
    run = run_scenario(scenario, ["adaptive_imm"], [seed], controllers=[controller])[0]
    late = run.table[run.table["time_s"] > DURATION_S - HOUR]
    return float(late["air_flow_m3_s"].median()), float(late["level_setpoint_m"].median())


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/modifiers"), help="folder of the scenarios")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, from 1 on")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = Table(
        "effect of the plant", "recovery", "seed", "best air [l/s]", "controller", "air [l/s]", "lost at rest"
    )
    cases = [(effect, recovery) for effect in EFFECTS for recovery in (False, True)]
    for effect, recovery in track(cases, "modifiers", console=Console(stderr=True)):
        name = f"{effect.replace(' ', '_')}_{'recovery' if recovery else 'grade'}.yaml"
        scenario = written(EFFECTS[effect], recovery, options.out / name).compiled()
        limits, prices, model = scenario.limits, scenario.prices, without_sensor_effects(scenario.plant_model)
        assert limits is not None and prices is not None
        for seed in range(1, options.seeds + 1):
            for controller in CONTROLLERS:
                air, level = rested(scenario, controller, seed)
                row = [scenario.file.inputs[q.column].values(scenario.starts[:1], 1)[0] for q in model.inputs]
                inputs = np.array(row, dtype=float)
                inputs[model.index("inputs", "level_setpoint")] = level
                steady, p = Steady(model, inputs, limits.inputs["air_flow"], prices), model.parameter_values
                best = steady.best(p)
                lost = 1 - steady.value(air, p) / steady.value(best, p)
                table.add_row(
                    effect,
                    "measured" if recovery else "not measured",
                    str(seed),
                    f"{1e3 * best:.3f}",
                    controller,
                    f"{1e3 * air:.3f}",
                    f"{lost:.3%}",
                )
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
