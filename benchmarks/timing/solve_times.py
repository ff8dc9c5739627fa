"""Solve times of the economic MPC in closed loop, each solver in turn with the others: `make bench`.

Every solver controls its own copy of the same cell, move by move in turn, so that a drifting machine hits all alike.
The controllers know state and parameters: what is compared are solvers, not estimates.
"""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Estimate, Sample, Status
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.flotation.economics import value_rates
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.timing.speed import Figure
from controllers.economic_mpc.controller import EconomicMpc
from controllers.economic_mpc.solvers.nlp_solvers import SOLVERS

MOVES, SHORT, MOVE_S = 80, 40, 30
TREE, STD = "fatrop, 9 scenarios", 0.02
ASKED_MS = {"ipopt": 25.0, "fatrop": 12.0, "rti": 6.0, TREE: 60.0}


class Decides(Protocol):
    """A controller that knows the cell: inputs (nu,) for state (nx,), parameters (np,) and inputs before (nu,)."""

    def __call__(self, time: float, state: FloatArray, parameters: FloatArray, held: FloatArray) -> FloatArray:
        """Inputs of the next move."""
        ...


class Ours:
    """The economic MPC with one of its solvers; with scenarios, its parameters are known to `STD`."""

    def __init__(self, scenario: Scenario, solver: str, scenarios: int = 1) -> None:
        setup = setup_of(scenario)
        self.model, self.adapted = setup.model, setup.model.indices("parameters", setup.parameters)
        self.controller = EconomicMpc(setup, solver=solver, scenarios=scenarios)
        self.std = STD if scenarios > 1 else 0.0
        self._ode = FastCall(self.model.ode)
        self.state = self.controller.init(0.0)

    def __call__(self, time: float, state: FloatArray, parameters: FloatArray, held: FloatArray) -> FloatArray:
        """Solve from the state."""
        nothing = np.zeros(len(self.model.outputs))
        theta = parameters[self.adapted]
        covariance = np.diag((self.std * theta) ** 2)
        predicted = self._ode(time, state, held, parameters)[1]  # scenarios ask how far past plans were off
        estimate = Estimate(time, predicted, nothing, nothing, theta, covariance, state, Status.OK)
        self.state, decision = self.controller.decide(self.state, Sample(time, held, nothing * np.nan), estimate)
        assert decision.status in (Status.OK, Status.SOFTENED), decision.message
        return decision.inputs


def setup_of(scenario: Scenario) -> ControllerSetup:
    """What a controller of a scenario is built for."""
    return ControllerSetup(
        scenario.model,
        scenario.dt,
        Realisation(scenario, 1).plan,
        scenario.setup.parameters,
        scenario.limits,
        scenario.prices,
    )


@dataclass
class TimedLoop:
    """One controller and its copy of the cell."""

    name: str
    decide: Decides
    state: FloatArray
    held: FloatArray
    value: float = 0.0
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        cpu = 1e3 * statistics.median(self.cpu[1:])
        late = 1e3 * np.quantile(self.wall[1:], 0.99)
        return f"{self.median_ms:.1f} ms (p99 {late:.1f}; CPU time of its thread {cpu:.1f})"

    @property
    def median_ms(self) -> float:
        """Time of a decision by the clock, the cold start apart [ms]."""
        return 1e3 * statistics.median(self.wall[1:])


def closed_loops(scenario: Scenario, controllers: dict[str, Decides], moves: int = MOVES) -> dict[str, TimedLoop]:
    """Run the controllers on `scenario`'s cell while C rises by 20 % and then n by 10 %; times and realised value."""
    model, theta, held = scenario.model, scenario.model.parameter_values, Realisation(scenario, 1).schedule[0]
    x0, step = steady_state(model, held).state, Stepper(model, scenario.dt)
    loops = {name: TimedLoop(name, decide, x0, held) for name, decide in controllers.items()}
    drift = dict(zip(("C", "n"), ((1.2, 0.1, 0.4), (1.1, 0.5, 0.8)), strict=True))
    for k in range(moves):
        p = theta.copy()
        for name, (change, begin, end) in drift.items():
            p[model.index("parameters", name)] *= np.interp(k / moves, [begin, end], [1.0, change])
        for loop in loops.values():
            _move(scenario, loop, step, p, k)
    return loops


def _move(scenario: Scenario, loop: TimedLoop, step: Stepper, p: FloatArray, k: int) -> None:
    model, prices = scenario.model, scenario.prices
    assert prices is not None
    now = float(MOVE_S * k)
    wall, cpu = time.perf_counter(), time.thread_time()
    loop.held = loop.decide(now, loop.state, p, loop.held)
    loop.wall.append(time.perf_counter() - wall)
    loop.cpu.append(time.thread_time() - cpu)
    run = step.simulate(loop.state, np.tile(loop.held, (MOVE_S, 1)), p, now)
    loop.state = run.states[-1]
    grade, recovery = (run.outputs[:, model.index("outputs", name)] for name in ("concentrate_grade", "recovery"))
    air, feed = (loop.held[model.index("inputs", name)] for name in ("air_flow", "feed_flow"))
    rich = p[model.index("parameters", "feed_concentration.chalcopyrite")]
    loop.value += float(sum(np.sum(r) for r in value_rates(grade, recovery, air, feed, rich, prices.prices()).values()))


def solver_figures() -> list[Figure]:
    """Time of a decision with each solver, horizon 20, and what each earned."""
    scenario = load_scenario("closed_loop_drift")
    ours: dict[str, Decides] = {name: Ours(scenario, name) for name in SOLVERS}
    loops = closed_loops(scenario, {**ours, TREE: Ours(scenario, "fatrop", 9)})
    figures = [
        Figure(f"Economic MPC, horizon 20, {n}", str(loop), f"<= {ASKED_MS[n]:g} ms", loop.median_ms <= ASKED_MS[n])
        for n, loop in loops.items()
    ]
    return [*figures, equal_economics("three solvers", [loops[name] for name in SOLVERS])]


def do_mpc_figures() -> list[Figure]:
    """The same problem in do-mpc (ipopt) beside ours, in turn; nothing where do-mpc is not installed."""
    if find_spec("do_mpc") is None:
        return [Figure("do-mpc on the same problem", "do-mpc is not installed", "", None)]
    from benchmarks.timing.do_mpc_reference import DoMpc

    scenario = load_scenario("closed_loop_drift")
    ours = {name: Ours(scenario, name) for name in SOLVERS}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its optional parts, and how it calls CasADi, are no concern here
        loops = closed_loops(scenario, {**ours, "do-mpc": DoMpc(scenario)}, moves=SHORT)
    theirs = loops.pop("do-mpc")
    figures = [Figure("do-mpc on the same problem (ipopt)", str(theirs), "", None)]
    for name, loop in loops.items():
        ratio = statistics.median(b / a for a, b in zip(loop.wall[1:], theirs.wall[1:], strict=True))
        figures.append(Figure(f"... against ours with {name}", f"{ratio:.1f} x faster", ">= 3 x", ratio >= 3))
    return [*figures, equal_economics("do-mpc among them", [*loops.values(), theirs])]


def equal_economics(who: str, loops: Sequence[TimedLoop]) -> Figure:
    """Largest relative difference of realised value."""
    values = [loop.value for loop in loops]
    apart = (max(values) - min(values)) / abs(statistics.median(values))
    return Figure(f"Realised economic value, {who}", f"{apart:.2%} apart", "<= 0.20%", apart <= 2e-3)


def hour_figures() -> list[Figure]:
    """One hour of closed loop at 1 s with RPEM and fatrop, from the scenario to its runs."""
    scenario = load_scenario("closed_loop_drift")
    wall, cpu = time.perf_counter(), time.process_time()
    run_scenario(scenario, ["rpem"], [1], controllers=["economic_mpc"])
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    measured = f"{cpu:.1f} s CPU (wall clock {wall:.1f})"
    return [Figure("Closed loop, 1 h at 1 s, RPEM and fatrop", measured, "<= 10 s", cpu <= 10)]
