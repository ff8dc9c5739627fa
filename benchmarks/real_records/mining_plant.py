"""Discovery on an industrial iron-ore flotation plant: `python -m benchmarks.real_records.mining_plant [hourly.csv]`.

The first 70 % of the record are searched and fitted; the last 30 % only report, once. Hour-ahead predictions may use
what was measured until the hour before; free runs may not. The data are not part of the repository: default ../shared.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import statsmodels.api as sm
from rich.console import Console
from rich.table import Table

from adaptive_flot.discovery.assessment.verification import whiteness
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.search.search import search
from adaptive_flot.discovery.test_design.separation import hold_time
from adaptive_flot.discovery.verdict.judge import judge
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.parallel import available_processes
from adaptive_flot.processes.iron_columns import make_model, read_record

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "mining-flotation-plant" / "hourly.csv"
TRAIN = 0.7
SHOWN = 6


def main(path: Path) -> int:
    """Search, predict, print; 2 where the data are absent."""
    if not path.is_file():
        print(
            f"{path}: no such file; give the hourly table of the plant: "
            "python -m benchmarks.real_records.mining_plant hourly.csv"
        )
        return 2
    record, model = read_record(path), make_model()
    cut = round(TRAIN * len(record))
    train = record.rows(0, cut)
    print(f"{len(record)} hours, {cut} to search and fit, {len(record) - cut} to report")
    print(discover(model, train, processes=available_processes()).verdict)
    before, after = attribution(model, train)
    table = Table("", "h ahead", *(f"{q.name} {k} [%]" for q in model.outputs for k in ("MAE", "RMS")))
    for name, ahead, predicted in predictions(record, cut, before, after):
        error = 100 * (record.outputs - predicted)[cut:]
        cells = [f"{v:.3f}" for e in error.T for v in (np.nanmean(np.abs(e)), np.sqrt(np.nanmean(e**2)))]
        table.add_row(name, ahead, *cells)
    Console(width=None if Console().is_terminal else 130).print(table)
    return 0


def attribution(model: Model, train: Dataset) -> tuple[Fit, Fit]:
    """Residual and search on the first part, also where the screening finds it insufficient: what it would find."""
    names = model.expand_parameters(p.name for p in model.parameters if p.role == "estimated")
    problem = make_problem(train, model, names, burn_in=30, guard=5)
    base = Fitter(problem).fit(model)
    assert base is not None  # the first guesses simulate
    fitted = zip(names, base.values, base.std(), strict=True)
    print("fitted:", ", ".join(f"{n} = {v:.3g} +- {s:.2g}" for n, v, s in fitted))
    print("residual, Ljung-Box p:", {k: f"{p:.1g}" for k, p in whiteness(problem, base, raw=True).items()})
    began = time.perf_counter()
    result = search(problem, base, model, processes=available_processes())
    judged = judge(result)
    print(f"search without the screening, {time.perf_counter() - began:.0f} s: {judged.word}; {result.verification}")
    ranked = result.alternatives or result.rounds[0].alternatives
    for a in ranked[:SHOWN]:
        print(f"  {' with '.join(f'{s} by {d}' for s, d in a.names)}: delta BIC {a.delta_bic:.0f}")
    return _refitted(problem, base, ranked[0].fit if ranked else base)


def _refitted(problem: Problem, base: Fit, best: Fit) -> tuple[Fit, Fit]:
    """Both once more, on all splits of the first part."""
    fitter = Fitter(problem, ("estimate", "confirm", "report"))
    before = fitter.fit(base.model, like=base, rounds=2) or base
    return before, fitter.fit(best.model, best.names, like=best, rounds=2) or best


def predictions(record: Dataset, cut: int, before: Fit, after: Fit) -> Iterator[tuple[str, str, FloatArray]]:
    """(name, how far ahead, predictions (N, m)) of every method, all fitted to the first `cut` rows."""
    y = record.outputs
    seen = last_seen(y)
    yield "mean of the first part", "-", np.tile(np.nanmean(y[:cut], axis=0), (len(y), 1))
    yield "linear regression (OLS) on same-hour inputs", "-", regression(record, cut, None)
    yield "column model, free run", "-", (plain := free_run(record, cut, before))
    yield "column model with the best alternative, free run", "-", (more := free_run(record, cut, after))
    yield "persistence", "1", seen
    yield "OLS on inputs and the last assays", "1", regression(record, cut, seen)
    yield "column model and its last residual", "1", corrected(plain, y, cut)
    yield "column model with the best alternative and its last residual", "1", corrected(more, y, cut)


def free_run(record: Dataset, cut: int, fit: Fit) -> FloatArray:
    """Simulation (N, m) over all rows; from `cut` on, effects of time stay as they were there."""
    end = float(record.time[cut - 1])
    parts: list[FloatArray] = []
    state = fit.initial_state
    for model, rows in ((fit.model, slice(1, cut)), (hold_time(fit.model, end), slice(cut, None))):
        start = float(record.time[0]) if not parts else end
        run = Stepper(model, record.dt).simulate(state, record.inputs[rows], model.parameter_values, start)
        parts.append(run.outputs)
        state = run.states[-1]
    return np.vstack([parts[0][:1], *parts])


def corrected(predicted: FloatArray, y: FloatArray, cut: int) -> FloatArray:
    """Prediction (N, m) plus rho times the last residual seen: an unmeasured feed that wanders (AR(1), rho by OLS)."""
    residual = y - predicted
    last = last_seen(residual)
    rho = np.array([_slope(last[:cut, j], residual[:cut, j]) for j in range(y.shape[1])])
    return predicted + rho * last


def regression(record: Dataset, cut: int, last: FloatArray | None) -> FloatArray:
    """Ordinary least squares (N, m) on the inputs and, if given, the last assays."""
    X = record.inputs if last is None else np.hstack([record.inputs, last])
    X = sm.add_constant((X - X[:cut].mean(axis=0)) / X[:cut].std(axis=0))
    columns_predicted = []
    for target in record.outputs.T:
        ok = np.isfinite(target[:cut])
        columns_predicted.append(sm.OLS(target[:cut][ok], X[:cut][ok]).fit().predict(X))
    return np.column_stack(columns_predicted)


def _slope(x: FloatArray, y: FloatArray) -> float:
    ok = np.isfinite(x) & np.isfinite(y)
    return float(sm.OLS(y[ok], x[ok]).fit().params[0])


def last_seen(y: FloatArray) -> FloatArray:
    """Last measured value before each row (N, m); the first measured one where there is none yet."""
    held = np.empty_like(y)
    for j, series in enumerate(y.T):
        ok = np.isfinite(series)
        at = np.maximum.accumulate(np.where(ok, np.arange(len(series)), -1))
        previous = np.concatenate([[-1], at[:-1]])
        held[:, j] = series[np.where(previous >= 0, previous, int(np.argmax(ok)))]
    return held


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA))
