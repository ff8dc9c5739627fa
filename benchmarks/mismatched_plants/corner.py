"""What a right gradient could win on the thirty plants, at rest: `python -m benchmarks.mismatched_plants.corner`.

Modifier adaptation corrects the slopes of a model by those of the plant (Marchetti, Chachuat & Bonvin, Industrial &
Engineering Chemistry Research 48 (2009) 6022). That changes nothing where limits alone say where to go: the level at an
end of its range and the grade at its limit, which the controller's bias finds. So each plant's own best steady state is
searched for, and compared with the place to which the controller's model leads: constants of the model, C such that the
measured grade is predicted, and no more air than keeps the plant's grade.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import brentq

from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.control.value_of_knowledge import Steady
from benchmarks.mismatched_plants.plants import COUNT, plant

KEPT = 0.01
"""Distance that the controller keeps from the limit of the grade."""
LEVELS = 5
EDGE = 2e-6
"""Air flows nearer than this are the same [m3/s]."""
STEPS = 20


class Cell:
    """Steady states of a scenario's plant, or of its model, at one level."""

    def __init__(self, scenario: Scenario, level: float, *, of_plant: bool) -> None:
        limits, prices = scenario.limits, scenario.prices
        assert limits is not None and prices is not None
        model = without_sensor_effects(scenario.plant_model) if of_plant else scenario.model
        row = [scenario.file.inputs[q.column].values(scenario.starts[:1], 1)[0] for q in model.inputs]
        inputs = np.array(row, dtype=float)
        inputs[model.index("inputs", "level_setpoint")] = level
        self.air, self.p = limits.inputs["air_flow"], model.parameter_values
        self.least = limits.outputs["concentrate_grade"][0] + KEPT
        self.steady, self._grade = Steady(model, inputs, self.air, prices), model.index("outputs", "concentrate_grade")
        self._c = model.index("parameters", "C")

    def grade(self, air: float) -> float:
        """Grade at an air flow [m3/s]."""
        return float(self.steady.point(air, self.p).outputs[self._grade])

    def most_air(self) -> float | None:
        """Most air that keeps the grade; None for none."""
        if self.grade(self.air[1]) >= self.least:
            return self.air[1]
        if self.grade(self.air[0]) < self.least:
            return None
        return float(brentq(lambda a: self.grade(a) - self.least, *self.air, xtol=1e-8))

    def best(self) -> float:
        """Air flow of the highest value, whatever the grade."""
        return self.steady.best(self.p)

    def show(self, grade: float, air: float) -> None:
        """Set C such that the cell has this grade at this air flow."""
        nominal = self.p[self._c]

        def excess(log: float) -> float:
            self.p[self._c] = nominal * np.exp(log)
            return self.grade(air) - grade

        self.p[self._c] = nominal * np.exp(brentq(excess, -2.5, 2.5, xtol=1e-6))


def line(scenario: Scenario) -> tuple[str, str, str]:
    """Name, where the best steady state lies, and what the controller loses there [cu/h]."""
    limits = scenario.limits
    assert limits is not None
    found = []
    for level in np.linspace(*limits.inputs["level_setpoint"], LEVELS):
        cell = Cell(scenario, float(level), of_plant=True)
        most = cell.most_air()
        if most is not None:
            air = min(cell.best(), most)
            found.append((cell.steady.value(air, cell.p), float(level), air, most))
    value, level, air, most = max(found)
    where = f"level {level:.2f} m, " + ("grade at its limit" if most - air < EDGE else "grade off its limit")
    own, model = Cell(scenario, level, of_plant=True), Cell(scenario, level, of_plant=False)
    at = air
    for _ in range(STEPS):
        model.show(own.grade(at), at)
        to = min(model.best(), most)
        if abs(to - at) < EDGE / 10:
            break
        at = to
    lost = value - own.steady.value(at, own.p)
    return scenario.name, where, f"{lost:.5f} ({lost / value:.3%})"


def main() -> None:
    """Search and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/mismatched_plants"), help="folder of the plants")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = Table("plant", "its best steady state", "lost by the model's slopes [cu/h]")
    for number in range(COUNT):
        table.add_row(*line(plant(number, options.out)))
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
