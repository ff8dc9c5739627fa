"""What short runs gain by a tape: beside a function of so many intervals, which CasADi makes. Ratios in one run.

Command: `python -m benchmarks.timing.short_runs` (half a minute). A search makes some hundred models and runs each of
them some ten times, with few steps where nodes are far apart. So the first run counts as much as the others.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.function_cache import forget_functions
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping import stepper as module
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import cascaded_tanks, flotation

STEPS = (45, 250)
KNOTS = tuple(np.linspace(0.0, 1000.0, 30))
AGAIN, REPEATS = 10, 5
NEVER = 10**9


def tanks_with_a_course() -> Model:
    """Two tanks whose pump follows a course of thirty knots in time."""
    return cascaded_tanks.make_model().with_effects([Effect("pump_flow", "time", "curve", settings={"knots": KNOTS})])


def times_of(make: Callable[[], Model], steps: int, least: int) -> FloatArray:
    """Milliseconds (4,): a first run, a further one, a first one with all derivatives, a further one; nothing kept."""
    forget_functions()
    model = make()
    wrt, nx = model.names("parameters"), len(model.states)
    inputs = np.tile([q.scale for q in model.inputs], (steps, 1))
    x, p, directions = model.first_guess, model.parameter_values, np.zeros((nx, len(wrt)))
    stepper = Stepper(model, model.max_step_s)
    ways = (
        lambda: stepper.simulate(x, inputs, p),
        lambda: stepper.simulate_sensitivities(x, inputs, p, wrt, directions),
    )
    found = []
    with patch.object(module, "LEAST_STEPS", least):
        for run in ways:
            marks = [time.process_time()]
            for _ in range(1 + AGAIN):
                run()
                marks.append(time.process_time())
            found += [marks[1] - marks[0], (marks[-1] - marks[1]) / AGAIN]
    return 1e3 * np.array(found)


def main() -> None:
    """Measure and print."""
    columns = ("first run", "further", "first with derivatives", "further")
    table = Table("model", "steps", *columns, title="Short runs in ms: by a loop that CasADi makes / by tape")
    for name, make in (("cell", flotation.make_model), ("two tanks, a course of 30 knots", tanks_with_a_course)):
        for steps in STEPS:
            pairs = [(times_of(make, steps, NEVER), times_of(make, steps, 1)) for _ in range(REPEATS)]
            loop, tape = (np.median([pair[i] for pair in pairs], axis=0) for i in range(2))
            table.add_row(name, str(steps), *(f"{a:.2f} / {b:.2f}" for a, b in zip(loop, tape, strict=True)))
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
