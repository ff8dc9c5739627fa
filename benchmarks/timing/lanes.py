"""Simulations, sensitivities and RPEM in lanes, each beside today's other ways, SciPy and JAX, timed in one run.

`python -m benchmarks.timing.lanes [--jax PYTHON]`; PYTHON is the interpreter of an environment with JAX, which this
project does not need. Times are processor time on one core: other work on the machine does not count, and two cores
give twice the rate where both are free. Ratios are those of median times taken in turn.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.contracts import Prior
from adaptive_flot.contracts.ensemble_record import EnsembleRecord
from adaptive_flot.greybox.ensemble import lane_library
from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.step_functions import sensitivity_step, step
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import InstructionSet, supported
from adaptive_flot.runner.commands.runs.run import AT_ONCE, run_one
from adaptive_flot.runner.commands.runs.side_by_side import run_side_by_side
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from benchmarks.timing import jax_step, scipy_reference
from benchmarks.timing.speed import in_turn
from estimators.rpem.estimator import Rpem

MEMBERS, ROWS, REPEATS = 64, 300, 7
SCIPY_ROWS = 100
RECORD_S = 2400


@dataclass(frozen=True)
class Way:
    """A way to do one thing: what it is, the work, and how many steps of members it takes."""

    what: str
    work: Callable[[], object]
    steps: int


@dataclass(frozen=True)
class _Case:
    """Members of the cell in scenario 1: states, inputs of the rows, parameters of each."""

    model: Model
    x0: FloatArray
    inputs: FloatArray
    parameters: FloatArray

    @classmethod
    def made(cls) -> _Case:
        scenario = load_scenario("paper_scenario_1")
        rng = np.random.default_rng(1)
        u = Realisation(scenario, 1).schedule[600 : 600 + ROWS]
        p = scenario.model.parameter_values * rng.uniform(0.97, 1.03, (MEMBERS, len(scenario.model.parameters)))
        return cls(scenario.model, steady_state(scenario.model, u[0]).state, u, p)


def simulations(case: _Case, jax: Path | None) -> list[tuple[Way, float]]:
    """Each way and its processor time a step [s]; the first is what the ratios are taken to."""
    quick = replace(case.model, compiled=True)
    ways = [_lanes(case, instructions) for instructions in supported()]
    one_by_one = case.parameters[:4]
    for what, model in (("compiled, one by one", quick), ("interpreted, one by one", case.model)):
        stepper = Stepper(model, 1.0)
        ways.append(Way(what, partial(_each, stepper, case, one_by_one), len(one_by_one) * ROWS))
    mapped = Ensemble(case.model, 1.0)
    ways.append(Way("CasADi's map", partial(_mapped, mapped, case, 50), MEMBERS * 50))
    ways.append(Way("SciPy, LSODA", partial(_scipy, case), SCIPY_ROWS))
    for way in ways:
        way.work()
    with patch.object(lane_library, "worker_threads", lambda: 1):
        times = np.median(in_turn([way.work for way in ways], REPEATS), axis=0)
    found = [(way, float(t) / way.steps) for way, t in zip(ways, times, strict=True)]
    if jax is not None:
        found.append((Way("JAX, jit and vmap", lambda: None, 0), _jax(case, jax)))
    return found


def _lanes(case: _Case, instructions: InstructionSet) -> Way:
    function = step(case.model, Stepper(case.model, 1.0).interval)
    lanes = Lanes(function, {"x": "x_next"}, as_machine_code=True, instructions=instructions)
    fixed, by_row = {"x": case.x0, "p": case.parameters}, {"t": np.zeros((ROWS, 1)), "u": case.inputs}
    name = f"lanes, {instructions.name}"
    return Way(name, lambda: lanes(MEMBERS, ROWS, fixed, by_row, every=["y"], last=["x_next"]), MEMBERS * ROWS)


def _each(stepper: Stepper, case: _Case, parameters: FloatArray) -> None:
    for p in parameters:
        stepper.simulate(case.x0, case.inputs, p)


def _mapped(ensemble: Ensemble, case: _Case, rows: int) -> None:
    ensemble.simulate(case.x0, case.inputs[:rows], case.parameters, keep=["outputs"])


def _scipy(case: _Case) -> None:
    theta, x = scipy_reference.THETA_NOMINAL, case.x0
    for u in case.inputs[:SCIPY_ROWS]:
        x = scipy_reference.step(x, u, theta, method="LSODA")


def _jax(case: _Case, python: Path) -> float:
    """Processor time a step of the same expression as JAX code, members innermost."""
    function = step(case.model, Stepper(case.model, 1.0).interval)
    with tempfile.TemporaryDirectory() as folder:
        source, data = Path(folder) / "step.py", Path(folder) / "case.npz"
        source.write_text(jax_step.source(function), encoding="utf-8")
        np.savez(data, x=np.tile(case.x0[:, None], MEMBERS), u=case.inputs, p=case.parameters.T)
        command = [str(python), jax_step.__file__, str(source), str(data), str(REPEATS)]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return float(said.split()[-1]) / (MEMBERS * ROWS)


def sensitivities(case: _Case) -> list[tuple[Way, float]]:
    """The step with derivatives for n and C: in lanes, and as one by one."""
    names = ("growth_exponent", "coalescence_rate")
    function = sensitivity_step(case.model, Stepper(case.model, 1.0).interval, names, 2)
    fixed = {"x": case.x0, "S": np.zeros((len(case.x0), 2)), "p": case.parameters}
    by_row = {"t": np.zeros((ROWS, 1)), "u": case.inputs}
    ways = []
    for instructions in supported():
        carried = {"x": "x_next", "S": "S_next"}
        lanes = Lanes(function, carried, as_machine_code=True, instructions=instructions)
        work = partial(lanes, MEMBERS, ROWS, fixed, by_row, every=["dy"])
        ways.append(Way(f"lanes, {instructions.name}", work, MEMBERS * ROWS))
    stepper = Stepper(replace(case.model, compiled=True), 1.0)
    start = np.zeros((len(case.x0), 2))
    one = partial(stepper.simulate_sensitivities, case.x0, case.inputs, case.parameters[0], names, start)
    ways.append(Way("compiled, one by one", one, ROWS))
    return _timed(ways)


def rpem(case: _Case) -> list[Way]:
    """RPEM over whole records: in lanes, one by one, and as the SciPy user writes it sample by sample."""
    scenario = load_scenario("paper_scenario_1").compiled()
    estimator = Rpem(scenario.setup)
    nominal = scipy_reference.THETA_NOMINAL.copy()
    prior = Prior(0.0, case.x0, nominal, np.diag((0.01 * nominal) ** 2), np.array([1e-3]))
    run = Stepper(case.model, 1.0).simulate(case.x0, case.inputs)
    noise = 1e-3 * np.random.default_rng(2).standard_normal((MEMBERS, *run.outputs.shape))
    y = run.outputs + noise
    record = EnsembleRecord(run.time, np.broadcast_to(case.inputs, (MEMBERS, *case.inputs.shape)), y)
    states = [estimator.init(prior)] * MEMBERS
    start = case.x0, nominal, prior.covariance / prior.noise_std[0] ** 2
    few = case.inputs[:SCIPY_ROWS], y[0, :SCIPY_ROWS, 0]
    return [
        Way("lanes, whole records", lambda: estimator.track_ensemble(states, record), MEMBERS * ROWS),
        Way("compiled, whole record", lambda: estimator.track(states[0], run.time, case.inputs, y[0]), ROWS),
        Way("SciPy, LSODA, by samples", lambda: scipy_reference.rpem(*start, *few, method="LSODA"), SCIPY_ROWS),
    ]


def study(estimator: str) -> list[tuple[Way, float]]:
    """Processor time a run of `paper_1000` with an estimator, its batch fit and its summary; a step is a run."""
    scenario = load_scenario("paper_scenario_1").compiled()
    prepared, seeds = Prepared.of(scenario, [estimator]), range(1, AT_ONCE + 1)

    def together() -> object:
        drawn = [Realisation(scenario, seed) for seed in seeds]
        return run_side_by_side(prepared, estimator, "schedule", drawn, [{} for _ in drawn])

    def alone() -> object:
        return run_one(prepared, estimator, "schedule", Realisation(scenario, 1), {})

    return _timed(
        [
            Way(f"{estimator}: {AT_ONCE} seeds side by side", together, AT_ONCE),
            Way(f"{estimator}: one seed alone", alone, 1),
        ]
    )


def _timed(ways: list[Way]) -> list[tuple[Way, float]]:
    for way in ways:
        way.work()
    with patch.object(lane_library, "worker_threads", lambda: 1):
        times = np.median(in_turn([way.work for way in ways], REPEATS), axis=0)
    return [(way, float(t) / way.steps) for way, t in zip(ways, times, strict=True)]


def _threads(case: _Case, tracked: Way, beside: float) -> str:
    """What two threads gain by the clock at this hour: simulations, and updates beside one of SciPy's [s]."""
    ensemble = Ensemble(replace(case.model, compiled=True), 1.0)
    p = np.tile(case.parameters, (8, 1))
    simulated = Way("", partial(ensemble.simulate, case.x0, case.inputs, p, keep=["outputs"]), len(p) * ROWS)
    one, two = (1 / (np.array(_by_the_clock(simulated)) * RECORD_S)).tolist()
    by_one, by_two = (beside / np.array(_by_the_clock(tracked))).tolist()
    return (
        f"By the clock, best of five: {one:.0f} simulations a second with one thread, {two:.0f} with two;\n"
        f"RPEM in lanes is {by_one:.0f} times as fast as SciPy with one thread, {by_two:.0f} times with two"
    )


def _by_the_clock(way: Way) -> list[float]:
    """Seconds a step with one thread and with two."""
    taken = []
    for threads in (1, 2):
        with patch.object(lane_library, "worker_threads", lambda n=threads: n):
            taken.append(min(_clock(way.work) for _ in range(5)) / way.steps)
    return taken


def _clock(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jax", type=Path, help="interpreter of an environment with JAX")
    jax, console = parser.parse_args().jax, Console(width=110)
    problem = compiler_problem()
    if problem is not None:
        console.print(f"Nothing compiled: {problem}")
        return
    case = _Case.made()
    tracking = rpem(case)
    tracked = _timed(tracking)
    console.print(f"Instruction set of this machine: {supported()[0].name}; {MEMBERS} members, {ROWS} rows")
    for title, found in (
        ("Simulation of the cell, 1 s steps", simulations(case, jax)),
        ("The same with derivatives for n and C", sensitivities(case)),
        ("RPEM, an update", tracked),
    ):
        table = Table("way", "ns a step", "runs of 2400 s a core-second", "times as long", title=title)
        for way, taken in found:
            rate = f"{1 / (taken * RECORD_S):.1f}"
            table.add_row(way.what, f"{1e9 * taken:.0f}", rate, f"{taken / found[0][1]:.1f}")
        console.print(table)
    runs = Table("way", "ms a run", "times as long", title="A run of the study paper_1000")
    for estimator in ("rpem", "adaptive_imm"):
        found = study(estimator)
        for way, taken in found:
            runs.add_row(way.what, f"{1e3 * taken:.1f}", f"{taken / found[0][1]:.1f}")
    console.print(runs)
    console.print(_threads(case, tracking[0], tracked[-1][1]))


if __name__ == "__main__":
    main()
