"""What knowing the parameters is worth, and what probing for it brings.

Command: `python -m benchmarks.control.value_of_knowledge`.

Two tables. The first needs a minute: what is lost at steady state by a controller that sees the right grade, but takes
one parameter for another. That is the most that any probing could win, an hour. The second runs the closed loop of
`interior_optimum` without and with detours that teach, paired by seed, about two minutes a seed. Its bound is an oracle
that is told the true parameters. Seed 1 is the one that was looked at while the option was made.

A run may end with less mineral in the cell than another one, and has sold it. So the value is also taken with an hour
after the end, in which every plant gets the same inputs: what is in the cell then comes out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table
from scipy.optimize import brentq, minimize_scalar

from adaptive_flot.contracts import OperatingPoint
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.commands.comparison import SeedSpread
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario

SCENARIO = "interior_optimum"
PASSIVE, PROBING, ESTIMATOR, ORACLE = "economic_mpc", "probing", "adaptive_imm", "oracle"
CASES = {"passive": (PASSIVE, ESTIMATOR), "probing": (PROBING, ESTIMATOR), "oracle": (PASSIVE, ORACLE)}
PAIRS = (("n", "C", (0.7, 0.85, 1.15, 1.3)), ("floatability.chalcopyrite", "C", (0.7, 0.85, 1.15, 1.3)))
TREATMENT = (0.15, 0.25)
HOUR = 3600.0
LATE_S = 1500.0
"""Errors of the parameters are taken after the drift and some minutes."""


class Steady:
    """Steady states of a cell at one level and feed, by air flow and parameters."""

    def __init__(self, model: Model, inputs: FloatArray, air: tuple[float, float], prices: Prices) -> None:
        self.model, self._inputs, self._air, self._prices = model, inputs, air, prices
        self._index = model.index("inputs", "air_flow")

    def point(self, air: float, p: FloatArray) -> OperatingPoint:
        """Operating point of an air flow [m3/s] and parameters (np,)."""
        u = self._inputs.copy()
        u[self._index] = air
        x = steady_state(self.model, u, p).state
        return OperatingPoint(self.model, x, u, np.array(self.model.ode(0.0, x, u, p)[1]).ravel(), p)

    def value(self, air: float, p: FloatArray) -> float:
        """Value [cu/h]."""
        return HOUR * float(sum(self._prices.rates(self.point(air, p), self._prices.prices()).values()))

    def best(self, p: FloatArray) -> float:
        """Air flow of the highest value [m3/s]."""
        found = minimize_scalar(
            lambda a: -self.value(a, p), bounds=self._air, method="bounded", options={"xatol": 1e-7}
        )
        return float(found.x)


def lost(steady: Steady, truth: FloatArray, wrong: str, other: str, factor: float) -> tuple[float, float]:
    """Value lost [cu/h] and share by which the air is off; `wrong` is off by a factor, and `other` makes up for it.

    The controller settles where its model has its optimum and shows the grade that is measured there.
    """
    model, best = steady.model, steady.best(truth)
    grade, i, j = model.index("outputs", "concentrate_grade"), *model.indices("parameters", (wrong, other))
    believed, air = truth.copy(), best
    believed[i] *= factor
    for _ in range(20):
        measured = steady.point(air, truth).outputs[grade]

        def excess(log: float, at: float = air, aim: float = measured) -> float:
            p = believed.copy()
            p[j] = truth[j] * np.exp(log)
            return float(steady.point(at, p).outputs[grade] - aim)

        believed[j] = truth[j] * np.exp(brentq(excess, -2.5, 2.5, xtol=1e-6))
        to = steady.best(believed)
        if abs(to - air) < 1e-7:
            break
        air = to
    return steady.value(best, truth) - steady.value(air, truth), air / best - 1


def at_stake(scenario: Scenario) -> Iterator[tuple[str, ...]]:
    """Lines of the first table."""
    limits = scenario.limits
    assert limits is not None
    row = [scenario.file.inputs[q.column].values(scenario.starts[:1], 1)[0] for q in scenario.model.inputs]
    inputs = np.array(row, dtype=float)
    inputs[scenario.model.index("inputs", "level_setpoint")] = limits.inputs["level_setpoint"][0]
    truth = scenario.model.parameter_values
    for treatment in TREATMENT:
        steady = Steady(scenario.model, inputs, limits.inputs["air_flow"], Prices(treatment=treatment))
        best = steady.best(truth)
        value = steady.value(best, truth)
        for wrong, other, factors in PAIRS:
            for factor in factors:
                try:
                    less, off = lost(steady, truth, wrong, other, factor)
                except (RangeError, ValueError):
                    shown = ("no other value shows the same grade", "")
                else:
                    shown = (f"{less:.5f} ({less / value:.3%})", f"{off:+.1%}")
                yield (f"{treatment:g}", f"{wrong} x {factor:g}, {other} makes up", *shown)


def settled_value(scenario: Scenario, run: Run, last: FloatArray) -> float:
    """Value from `fits_after_s` to an hour after the end, by the hours up to the end [cu/h].

    Parameters
    ----------
    scenario
        Of the run; its plant has no noise but that of measurements.
    run
        The run.
    last
        Inputs of the hour after it (nu,).
    """
    model, table, prices = scenario.model, run.table, scenario.prices
    assert prices is not None
    after = round(HOUR / scenario.dt)
    inputs = table[[q.column for q in model.inputs]].to_numpy(dtype=float)
    p = np.tile(model.parameter_values, (len(table), 1))
    for name in scenario.file.parameters:
        p[:, model.index("parameters", name)] = table[f"{name}_true"]
    every, of_all = np.vstack([inputs, np.tile(last, (after, 1))]), np.vstack([p, np.tile(p[-1], (after, 1))])
    x = steady_state(model, inputs[0], p[0]).state
    outputs = Stepper(model, scenario.dt).simulate(x, every, of_all).outputs
    grade = outputs[: len(table), model.index("outputs", "concentrate_grade")]
    np.testing.assert_allclose(grade, table["concentrate_grade_true"], atol=1e-6, err_msg="not the plant of the run")
    point = OperatingPoint(model, None, every.T, outputs.T, of_all.T)
    rates = np.asarray(sum(prices.rates(point, prices.prices()).values()))
    counted = np.append(table["time_s"].to_numpy() > scenario.fits_after, np.ones(after, dtype=bool))
    return float(HOUR * rates[counted].sum() / (table["time_s"] > scenario.fits_after).sum())


def measured(scenario: Scenario, seed: int) -> dict[str, float]:
    """Figures of one seed: values, errors of the parameters, time on detours."""
    found: dict[str, float] = {}
    runs = {
        case: run_scenario(scenario, [estimator], [seed], controllers=[controller])[0]
        for case, (controller, estimator) in CASES.items()
    }
    last = runs["oracle"].table[[q.column for q in scenario.model.inputs]].to_numpy(dtype=float)[-1]
    for case, run in runs.items():
        found[f"{case}: settled value"] = settled_value(scenario, run, last)
    for case, run in runs.items():
        found[f"{case}: value"] = run.account["value_cu_h"]
        late = run.table[run.table["time_s"] > LATE_S]
        for name in (q for q in late.columns if q.endswith("_estimate")):
            parameter = name.removesuffix("_estimate")
            error = np.abs(late[name] / late[f"{parameter}_true"] - 1)
            found[f"{case}: error of {parameter}"] = float(np.median(error))
        found[f"{case}: time on detours"] = float(np.mean(run.table["decided_by"] == "probing"))
    for kind in ("value", "settled value"):
        found[f"gap, {kind}"] = found[f"oracle: {kind}"] - found[f"passive: {kind}"]
        found[f"gained, {kind}"] = found[f"probing: {kind}"] - found[f"passive: {kind}"]
    return found


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first-seed", type=int, default=2)
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds; 0 for the first table alone")
    parser.add_argument("--out", type=Path, help="also write the figures of each seed to this CSV file, as they come")
    options = parser.parse_args()
    scenario, console = load_scenario(SCENARIO).compiled(), Console(width=None if Console().is_terminal else 130)
    table = Table("treatment [cu/kg]", "estimate is off by", "lost [cu/h]", "air off by", title="At stake, at rest")
    for line in at_stake(scenario):
        table.add_row(*line)
    console.print(table)
    rows: list[dict[str, float]] = []
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        rows.append({"seed": seed} | measured(scenario, seed))
        Console(stderr=True).print({k: round(v, 4) for k, v in rows[-1].items()})
        if options.out is not None:
            pd.DataFrame(rows).to_csv(options.out, index=False)
    if rows:
        table = Table("figure", "median [range]", title=f"{SCENARIO}, {len(rows)} seeds")
        for name, values in pd.DataFrame(rows).drop(columns="seed").items():
            spread = SeedSpread.of(values.to_numpy(dtype=float))
            table.add_row(str(name), f"{spread.median:.4f} [{spread.low:.4f}, {spread.high:.4f}]")
        console.print(table)


if __name__ == "__main__":
    main()
