"""Speed of simulation and estimation, each against a reference timed in the same run, in turn with it.

Absolute times depend on the machine; the ratio of two medians of one run is what can be compared.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.greybox.stepper import Stepper
from adaptive_flot.protocols import Prior, Sample
from adaptive_flot.runner.scenario import Scenario, load_scenario
from adaptive_flot.runner.scenario_plant import simulate_plant
from benchmarks import scipy_reference
from estimators.rpem import Rpem

REPEATS = 7
SCIPY_UPDATES = 150


@dataclass(frozen=True)
class Figure:
    """One line of the table: what, measured value with unit, the limit asked for ("" if none)."""

    what: str
    measured: str
    limit: str
    met: bool | None


def seconds(work: Callable[[], object]) -> float:
    """Wall-clock time of one call [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def paired(a: Callable[[], object], b: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float, float]:
    """Median times of two pieces of work [s] and median ratio b / a, run in turn: a drifting machine hits both."""
    times = [(seconds(a), seconds(b)) for _ in range(repeats)]
    columns = (t[0] for t in times), (t[1] for t in times), (t[1] / t[0] for t in times)
    first, second, ratio = (statistics.median(column) for column in columns)
    return first, second, ratio


@dataclass(frozen=True)
class _Record:
    """Scenario 1, seed 1: samples after 600 s and where the estimators start."""

    scenario: Scenario
    prior: Prior
    inputs: FloatArray
    grade: FloatArray
    samples: list[Sample]


def _record() -> _Record:
    scenario = load_scenario("paper_scenario_1")
    model, schedule = scenario.model, scenario.schedule(1)
    samples = [record.sample for record in simulate_plant(scenario, 1)]
    start = steady_state(model, schedule[scenario.initial_rows]).state
    nominal = scipy_reference.THETA_NOMINAL.copy()
    prior = Prior(600.0, start, nominal, np.diag((0.01 * nominal) ** 2), np.array([1e-3]))
    late = samples[scenario.initial_rows :]
    grade = np.array([s.outputs[0] for s in late])
    return _Record(scenario, prior, schedule[scenario.initial_rows :], grade, late)


def rpem_figures() -> list[Figure]:
    """RPEM over scenario 1 against the plain SciPy implementation, for each integrator a user may choose."""
    record = _record()
    estimator = Rpem(record.scenario.setup)

    def ours() -> None:
        state = estimator.init(record.prior)
        for sample in record.samples:
            state, _ = estimator.update(state, sample)

    ours()
    updates = len(record.samples)
    figures = []
    methods: tuple[scipy_reference.Method, ...] = ("RK45", "LSODA", "BDF")
    for method in methods:
        theirs = _scipy_rpem(record, method)
        fast, slow, ratio = paired(ours, theirs)
        ratio *= updates / SCIPY_UPDATES
        what = f"RPEM update against SciPy reference, solve_ivp({method}) at rtol 1e-8"
        measured = f"{ratio:.0f} x faster ({1e3 * slow / SCIPY_UPDATES:.2f} ms)"
        figures.append(Figure(what, measured, ">= 100 x", ratio >= 100))
    figures.insert(0, Figure(f"RPEM over scenario 1, {updates} updates", f"{fast:.3f} s", "<= 1.0 s", fast <= 1.0))
    return figures


def _scipy_rpem(record: _Record, method: scipy_reference.Method) -> Callable[[], object]:
    inverse_hessian = record.prior.covariance / record.prior.noise_std[0] ** 2
    inputs, grade = record.inputs[:SCIPY_UPDATES], record.grade[:SCIPY_UPDATES]
    start = record.prior.state, record.prior.parameters, inverse_hessian
    return lambda: scipy_reference.rpem(*start, inputs, grade, method=method)


def simulation_figures() -> list[Figure]:
    """2400 s at 1 s: fast step and accurate integrator."""
    scenario = load_scenario("paper_scenario_1")
    schedule, p = scenario.schedule(1), scenario.true_parameters(1)
    x0 = steady_state(scenario.model, schedule[0]).state
    figures = []
    for name, stepper, limit in (
        ("fast step", Stepper(scenario.model, 1.0), 0.15),
        ("accurate (IDAS, 1e-11)", Stepper(scenario.model, 1.0, accurate=True), None),
    ):
        stepper.simulate(x0, schedule, p)
        t = statistics.median(seconds(partial(stepper.simulate, x0, schedule, p)) for _ in range(REPEATS))
        met = t <= limit if limit else None
        figures.append(Figure(f"Simulating 2400 s, {name}", f"{t:.3f} s", f"<= {limit} s" if limit else "", met))
    return figures


def start_figures() -> list[Figure]:
    """Time from typing `adaptive-flot run` to the printed fits and to the report; one estimator, one seed."""
    code = "from adaptive_flot.cli import main; main()"
    first, last = [], []
    for _ in range(5):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", code, "run", "paper_scenario_1", "--estimator", "rpem", "--out", folder]
            begin = time.perf_counter()
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
                assert process.stdout is not None
                fits = next((line for line in process.stdout if "paper_scenario_1" in line), None)
                assert fits is not None, "the run printed no fits"
                first.append(time.perf_counter() - begin)
                process.stdout.read()
            last.append(time.perf_counter() - begin)
    t, whole = statistics.median(first), statistics.median(last)
    return [
        Figure("`adaptive-flot run`: fits printed, results written", f"{t:.1f} s", "<= 5 s", t <= 5.0),
        Figure("`adaptive-flot run`: HTML report written too", f"{whole:.1f} s", "", None),
    ]
