"""What RPEM absorbs of an effect that no model has, and what discovery in the loop finds.

The table is in `docs/results/closed_loop.md`.
`python -m benchmarks.estimation.undeclared_effect` runs the scenario of that name over three seeds, two minutes.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table

from adaptive_flot.discovery.candidates.spline import drawn
from adaptive_flot.greybox.forms.form import number
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.run.series import cases
from adaptive_flot.runner.adaptation.inquiry import Inquiry
from adaptive_flot.runner.adaptation.whiteness_watch import watch
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.prediction import one_move_errors, one_step_errors, rms
from adaptive_flot.runner.scenario.discovery_options import DiscoveryOptions
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.control.freezing import spread

SCENARIO, SEEDS, OUTPUT = "undeclared_effect", (1, 2, 3), "concentrate_grade"
LABELS = ("n", "C")


def offset(table: pd.DataFrame, label: str) -> FloatArray:
    """By how much an adapted parameter differs from the truth, in percent of it, at each row (N,)."""
    relative: FloatArray = 100 * (table[f"{label}_estimate"] / table[f"{label}_true"] - 1).to_numpy(dtype=float)
    return relative[np.isfinite(relative)]


def not_white(table: pd.DataFrame, after: float) -> str:
    """Windows whose innovations fail the test that the runner watches with, and windows tested."""
    options = DiscoveryOptions()
    rows = round(options.window_s / float(table["time_s"].diff().median()))
    seen = table[table["time_s"] > after + 1e-9][f"{OUTPUT}_innovation"].to_numpy(dtype=float)
    windows = [seen[k : k + rows] for k in range(0, len(seen) - rows + 1, rows)]
    return f"{sum(watch({OUTPUT: w}, options.false_alarm) is not None for w in windows)} of {len(windows)}"


def figures(scenario: Scenario, runs: list[Run]) -> dict[str, str]:
    """Figures of one estimator by name: median and range over the seeds; where a word says so, each seed's."""
    (case,) = cases([(scenario, runs)])
    tables = [case.shown(run) for run in runs]
    ahead = [one_move_errors(t, run.plans)["error"].to_numpy(dtype=float) for t, run in zip(tables, runs, strict=True)]
    rows = {
        "error one sample ahead, 1e-4": spread([1e4 * rms(one_step_errors(t, OUTPUT)) for t in tables], 1),
        "error one move ahead, 1e-4": spread([1e4 * rms(error) for error in ahead], 1),
    }
    for label in LABELS:
        off = [offset(t, label) for t in tables]
        rows[f"{label} off by, %"] = spread([float(np.median(o)) for o in off], 1)
        rows[f"{label} off by at times, %"] = f"{min(o.min() for o in off):.0f} to {max(o.max() for o in off):.0f}"
    for name, scale, digits in (("recovery", 1, 4), ("below_limit", 100, 2), ("value_cu_h", 1, 3)):
        shown = {"below_limit": "below limit, % of time", "value_cu_h": "value, cu/h"}.get(name, name)
        rows[shown] = spread([scale * run.account[name] for run in runs], digits)
    for words, after in (("all", scenario.initial_rows * scenario.dt), ("late", scenario.fits_after)):
        rows[f"{words} windows not white, each seed"] = ", ".join(not_white(run.table, after) for run in runs)
    return rows


def described(scenario: Scenario, run: Run, inquiry: Inquiry) -> str:
    """One search in words, with the size of what was found and of what is there."""
    words = f"seed {run.seed}: alarm at {inquiry.alarm_s:g} s, result at {inquiry.judged_s:g} s: "
    if inquiry.verdict is None or not inquiry.verdict.effects:
        return f"{words}{inquiry.why or (inquiry.verdict and inquiry.verdict.word)}"
    effect = inquiry.verdict.effects[0].effect
    words += f"{inquiry.verdict.word}, {effect.site} by {effect.driver} ({effect.form})"
    errors = "; ".join(f"{name} {a:.3e} to {b:.3e}" for name, (a, b) in inquiry.errors.items())
    words += f"; one-step error between search and result, noise included: {errors}" if errors else ""
    (there,) = scenario.plant_model.fitted_effects()
    if not effect.family.is_curve or (effect.site, effect.driver) != (there.site, there.driver):
        return words
    air = run.table.loc[run.table["time_s"].between(*inquiry.record_s), f"{effect.driver}_m3_s"]
    ends = np.array([air.min(), air.max()])
    slope = there.coefficients["slope"] / number(there.full_settings, "reference")  # its form is linear
    estimated, true = (100 * np.expm1(change) for change in (np.diff(drawn(effect, ends))[0], slope * np.ptp(ends)))
    return f"{words}; over the air of the record + {estimated:.1f} %, in the plant + {true:.1f} %"


def main() -> None:
    """Measure and print."""
    scenario = load_scenario(SCENARIO)
    columns, lines = {}, []
    for name in scenario.file.estimators:
        runs = run_scenario(scenario, [name], SEEDS)
        columns[name] = figures(scenario, runs)
        lines += [described(scenario, run, i) for run in runs for i in run.inquiries or ()]
    title = f"{SCENARIO}, seeds {SEEDS[0]} to {SEEDS[-1]}, t > {scenario.fits_after:g} s: median and range"
    table = Table("figure", *columns, title=title)
    for figure in next(iter(columns.values())):
        table.add_row(figure, *(columns[name][figure] for name in columns))
    console = Console(width=None if Console().is_terminal else 180)
    console.print(table)
    for line in lines:
        console.print(line, soft_wrap=True)


if __name__ == "__main__":
    main()
