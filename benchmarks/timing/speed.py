"""Speed of simulation and estimation, each against a reference timed in the same run, in turn with it.

Absolute times depend on the machine; the median ratio of times taken in turn is what can be compared.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from adaptive_flot.contracts import Prior, Sample
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.plants.scenario_plant import simulate_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.timing import scipy_reference
from estimators.rpem.estimator import Rpem

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
    """Processor time of one call [s]: on a quiet machine the wall-clock time, on a busy one still that of the work."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def in_turn(works: Sequence[Callable[[], object]], repeats: int = REPEATS) -> FloatArray:
    """Times of pieces of work [s] (repeats, works), taken in turn: a drifting machine hits all of them."""
    return np.array([[seconds(work) for work in works] for _ in range(repeats)])


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
    model, schedule = scenario.model, Realisation(scenario, 1).schedule
    samples = [record.sample for record in simulate_plant(Realisation(scenario, 1))]
    start = steady_state(model, schedule[scenario.initial_rows]).state
    nominal = scipy_reference.THETA_NOMINAL.copy()
    prior = Prior(600.0, start, nominal, np.diag((0.01 * nominal) ** 2), np.array([1e-3]))
    late = samples[scenario.initial_rows :]
    grade = np.array([s.outputs[0] for s in late])
    return _Record(scenario, prior, schedule[scenario.initial_rows :], grade, late)


def rpem_figures() -> list[Figure]:
    """RPEM over scenario 1, plain and compiled, against the plain SciPy implementation with each integrator."""
    record = _record()
    ours = _ours(record)
    methods: tuple[scipy_reference.Method, ...] = ("RK45", "LSODA", "BDF")
    for work in ours.values():
        work()
    times = in_turn([*ours.values(), *(_scipy_rpem(record, method) for method in methods)])
    updates, n = len(record.samples), len(ours)
    figures = []
    for (name, _), taken in zip(ours.items(), np.median(times, axis=0), strict=False):
        limit = 0.06 if "compiled" in name else 0.3
        what = f"RPEM over scenario 1, {updates} updates, {name}"
        figures.append(Figure(what, f"{taken:.4f} s", f"<= {limit} s", bool(taken <= limit)))
    for j, method in enumerate(methods):
        each = times[:, n + j] / SCIPY_UPDATES
        for i, name in enumerate(ours):
            ratio = float(np.median(each * updates / times[:, i]))
            limit = 500 if "compiled" in name else 100
            what = f"RPEM, {name}, against solve_ivp({method})"
            measured = f"{ratio:.0f} x faster ({1e3 * np.median(each):.2f} ms an update)"
            figures.append(Figure(what, measured, f">= {limit} x", ratio >= limit))
    return figures


def _ours(record: _Record) -> dict[str, Callable[[], object]]:
    """The same work in our ways; the last is what the SciPy reference is: a record in, arrays out."""
    compiled = compiler_problem() is None
    plain, quick = (
        Rpem(s.setup) for s in (record.scenario, record.scenario.compiled() if compiled else record.scenario)
    )
    time_s, outputs = np.array([s.time for s in record.samples]), np.array([s.outputs for s in record.samples])

    def by_samples(estimator: Rpem) -> None:
        state = estimator.init(record.prior)
        for sample in record.samples:
            state, _ = estimator.update(state, sample)

    def whole(estimator: Rpem) -> None:
        estimator.track(estimator.init(record.prior), time_s, record.inputs, outputs)

    works: dict[str, Callable[[], object]] = {"plain": partial(by_samples, plain)}
    works["plain, whole record"] = partial(whole, plain)
    if compiled:
        works |= {"compiled": partial(by_samples, quick), "compiled, whole record": partial(whole, quick)}
    return works


def _scipy_rpem(record: _Record, method: scipy_reference.Method) -> Callable[[], object]:
    inverse_hessian = record.prior.covariance / record.prior.noise_std[0] ** 2
    inputs, grade = record.inputs[:SCIPY_UPDATES], record.grade[:SCIPY_UPDATES]
    start = record.prior.state, record.prior.parameters, inverse_hessian
    return lambda: scipy_reference.rpem(*start, inputs, grade, method=method)


def simulation_figures() -> list[Figure]:
    """2400 s at 1 s: fast step and accurate integrator."""
    scenario = load_scenario("paper_scenario_1")
    schedule, p = Realisation(scenario, 1).schedule, Realisation(scenario, 1).parameters
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
