"""Economic model predictive control that reads the newest estimate and never applies an input it has not checked."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import (
    AnyController,
    ControllerSetup,
    Decision,
    Estimate,
    Plan,
    Sample,
    Status,
    full_parameters,
)
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.fastcall import FastCall
from controllers.economic_mpc.collocation import Problem
from controllers.economic_mpc.grade_bias import GradeBias
from controllers.economic_mpc.layout import MOVED, Bounds
from controllers.economic_mpc.nlp_solvers import FailingSolver, make_solver
from controllers.economic_mpc.probing import AIR, ProbeState, Probing, price
from controllers.economic_mpc.softening import widened
from controllers.economic_mpc.stage import Arguments
from controllers.economic_mpc.verification import Solution, Solver, Verdict

OWN = "economic_mpc"
VALUE_SCALE = 1000.0
"""Prices are scaled so that the objective is of order 1 to 100: solvers' tolerances then mean something."""


@dataclass(frozen=True)
class MpcState:
    """What the next decision needs.

    Attributes
    ----------
    row
        Interval to come, counted from the start.
    due
        Time of the next optimisation [s].
    inputs
        Inputs held now (nu,); None before the first decision.
    plan
        Scaled solution of the last valid optimisation, and its multipliers; None before the first.
    age
        Moves of that plan that have been used.
    bias
        Filtered measured minus predicted grade: added to every prediction, so that a model that is off does not break
        the limit for good.
    heard
        Time of the newest grade in that filter [s].
    probe
        Last dip and what probing has cost; None without probing.
    """

    row: int
    due: float
    inputs: FloatArray | None
    plan: FloatArray | None
    multipliers: tuple[FloatArray, FloatArray] | None
    age: int
    bias: float
    heard: float
    probe: ProbeState | None = None


class EconomicMpc:
    """Moves air flow and level set-point for the best economic value above a grade limit.

    Every `move_s` seconds an optimal control problem over `horizon` moves is solved from the estimated state with the
    newest parameter estimate (`collocation.py`). A solution is applied only if it is finite, within its bounds and
    meets the constraints; else one cold start is tried, then the plan of the step before goes on, then the inputs are
    held, then the first planned inputs are applied; `Decision` says which.

    Parameters
    ----------
    setup
        Model, schedule, adapted parameters, limits and prices.
    horizon
        Number of moves looked ahead.
    move_s
        Length of a move [s], a multiple of the sampling interval.
    solver
        `ipopt`, `fatrop` or `rti`.
    move_cost
        Cost of a move by the whole scale of an input (1e-3 m3/s of air, 0.1 m of level), squared [cu].
    grade_penalty
        Cost of a second at one percentage point below the grade limit [cu]; large: the limit is soft, but exact.
    backoff
        Kept above the grade limit [-]: what changes between two moves, and what the estimate is off by.
    bias_time_s
        Time constant of the grade bias filter [s].
    budget_s
        Wall-clock time of a solve; there is no second try when the first took longer.
    probing
        Options of `Probing`: dips of the air flow that tell the parameters apart; default none.

    Raises
    ------
    ModelError
        Limits or prices are missing, or an option is outside its range.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        *,
        horizon: int = 20,
        move_s: float = 30.0,
        solver: str = "ipopt",
        move_cost: float = 1e-3,
        grade_penalty: float = 1e-3,
        backoff: float = 0.001,
        bias_time_s: float = 20.0,
        budget_s: float = 5.0,
        probing: Mapping[str, float] | None = None,
    ) -> None:
        if setup.limits is None or setup.prices is None:
            raise ModelError("economic_mpc needs limits and prices; add 'limits' and 'economics' to the scenario")
        if horizon < 1 or not move_s >= setup.dt or not budget_s > 0 or not bias_time_s > 0:
            raise ModelError("economic_mpc: horizon, move_s, bias_time_s and budget_s must be positive, move_s >= dt")
        for name in MOVED:
            if name not in setup.limits.inputs or name not in setup.limits.moves:
                raise ModelError(f"economic_mpc moves {name!r}; give its range and its largest move in 'limits'")
        self.setup = setup
        self.problem = Problem(setup.model, horizon, move_s)
        self.layout = self.problem.layout
        self.solver: Solver = make_solver(self.problem, solver, budget_s)
        self.budget_s = budget_s
        self.grade_limit = setup.limits.grade + backoff
        self._prices = VALUE_SCALE * np.array([*setup.prices.values(), move_cost, grade_penalty])
        limits = setup.limits
        self._bounds = Bounds(
            inputs=np.array([limits.inputs[name] for name in MOVED]),
            moves=np.array([limits.moves[name] for name in MOVED]),
            level=np.array(limits.level),
        )
        self._solver_bounds = self.layout.bounds(self._bounds)
        self._bias = GradeBias(setup.model.index("outputs", "concentrate_grade"), setup.dt, bias_time_s)
        self.probing = None if probing is None else Probing(limits, move_s, **probing)
        self._ode = FastCall(setup.model.ode)
        self._grades = FastCall(self.problem.grades)

    def init(self, time: float) -> MpcState:
        """Nothing is planned yet."""
        return MpcState(0, time, None, None, None, 0, 0.0, time, None if self.probing is None else ProbeState(time))

    def with_failing_solver(self) -> EconomicMpc:
        """The same controller, states included, whose optimisations find nothing: a drill of what decides then."""
        drill = copy.copy(self)
        drill.solver = FailingSolver()
        return drill

    def take_over(
        self, before: AnyController, state: MpcState, known: Sequence[Estimate], again: Sequence[Estimate]
    ) -> MpcState:
        """Go on with the inputs and the plan of the same controller for a smaller model; see `TakesOver.take_over`."""
        if not isinstance(before, EconomicMpc):
            raise ModelError("economic_mpc: only the state of an economic_mpc can be taken over")
        state = replace(state, bias=state.bias + self._bias.change(known, again))
        if state.plan is None or len(self.setup.model.states) == len(before.setup.model.states):
            return state
        plan = widened(state.plan, before.layout, self.layout, again[-1].state)
        return replace(state, plan=plan, multipliers=None)

    def decide(self, state: MpcState, sample: Sample | None, estimate: Estimate | None) -> tuple[MpcState, Decision]:
        """Inputs of the next interval: the planned ones until there is an estimate, then the optimiser's."""
        state = self._listen(replace(state, row=state.row + 1), estimate)
        if sample is None or estimate is None:
            row = min(state.row, len(self.setup.schedule)) - 1
            inputs = self.setup.schedule[row].copy()
            return replace(state, inputs=inputs), Decision(inputs.copy(), Status.OK, "schedule")
        held = sample.inputs.copy()  # the newest of the disturbances
        if state.inputs is not None:
            held[self.layout.moved] = state.inputs[self.layout.moved]
        if sample.time < state.due - 1e-9:
            return replace(state, inputs=held.copy()), Decision(held.copy(), Status.OK, self._own(state, sample.time))
        state = replace(state, due=max(state.due, sample.time) + self.layout.move_s)
        return self._optimise(state, held, sample, estimate)

    def _listen(self, state: MpcState, estimate: Estimate | None) -> MpcState:
        if estimate is None:
            return state
        bias, heard = self._bias.after(state.bias, state.heard, estimate)
        return replace(state, bias=bias, heard=heard)

    def _optimise(
        self, state: MpcState, held: FloatArray, sample: Sample, estimate: Estimate
    ) -> tuple[MpcState, Decision]:
        model, moved = self.setup.model, self.layout.moved
        theta = full_parameters(model, self.setup.parameters, estimate.parameters, sample.parameters)
        others = np.delete(held, moved)
        now = Arguments(
            estimate.state, held[moved], theta, others, self.grade_limit, state.bias, self._prices, estimate.time
        ).vector()
        solution, status = self._solve(state, now, held, estimate, theta)
        if solution.verdict is Verdict.VALID and self.probing is not None:
            state, solution = self._probe(self.probing, state, now, held, estimate, solution)
        if solution.verdict is Verdict.VALID:
            plan = replace(state, plan=solution.variables, multipliers=solution.multipliers, age=0)
            expected = self._plan(estimate.time, solution, now)
            first = self.layout.inputs_of(solution.variables)[0]
            return self._apply(plan, held, first, status, solution, expected)
        if state.plan is not None and state.age + 1 < self.layout.horizon:
            older = replace(state, age=state.age + 1)
            planned = self.layout.inputs_of(state.plan)[older.age]
            return self._apply(older, held, planned, Status.SHIFTED_PLAN, solution)
        if np.isfinite(held).all():
            return self._apply(state, held, held[moved], Status.HELD, solution)
        return self._apply(state, self.setup.schedule[0], self.setup.schedule[0][moved], Status.SAFE_INPUT, solution)

    def _solve(
        self, state: MpcState, now: FloatArray, held: FloatArray, estimate: Estimate, theta: FloatArray
    ) -> tuple[Solution, Status]:
        """Warm from the last plan, then once cold."""
        z = self._ode(estimate.time, estimate.state, held, theta)[3]
        cold = self.layout.start(estimate.state, held[self.layout.moved], z)
        if state.plan is None or state.age > 0:  # what is left of a plan from before a failure is no start
            return self.solver(now, self._solver_bounds, cold), Status.OK
        shifted = self.layout.shifted(state.plan)
        multipliers = self.layout.shifted_multipliers(state.multipliers) if state.multipliers else None
        solution = self.solver(now, self._solver_bounds, shifted, multipliers)
        if solution.verdict is Verdict.VALID or solution.seconds > self.budget_s:
            return solution, Status.OK
        return self.solver(now, self._solver_bounds, cold), Status.RETRIED

    def _probe(
        self, probing: Probing, state: MpcState, now: FloatArray, held: FloatArray, estimate: Estimate, free: Solution
    ) -> tuple[MpcState, Solution]:
        """Put a dip in front of a valid plan where one is due, has a valid plan itself, and can be paid."""
        probe, air = state.probe, float(held[self.layout.moved[AIR]])
        if probe is None or not probing.is_due(probe, estimate, air):
            return state, free
        bounds = probing.bounds(air, self.layout, self._solver_bounds)
        asked = self.solver(now, bounds, free.variables, free.multipliers)
        if asked.verdict is not Verdict.VALID:
            return state, free
        cost = price(self.problem, free.variables, asked.variables, now) / VALUE_SCALE
        probe, paid = probing.pay(probe, cost, estimate.time)
        return replace(state, probe=probe), replace(asked, seconds=free.seconds + asked.seconds) if paid else free

    def _plan(self, time: float, solution: Solution, now: FloatArray) -> Plan:
        inputs = self.layout.inputs_of(solution.variables)
        ends = time + self.layout.move_s * np.arange(1.0, self.layout.horizon + 1)
        (grade,) = self._grades(solution.variables, now)
        return Plan(ends, {name: inputs[:, i] for i, name in enumerate(MOVED)}, grade)

    def _apply(
        self, state: MpcState, held: FloatArray, to: FloatArray, status: Status, by: Solution, plan: Plan | None = None
    ) -> tuple[MpcState, Decision]:
        inputs = held.copy()
        low, high = self._bounds.inputs.T
        inputs[self.layout.moved] = np.clip(to, low, high)  # a valid solution may miss a bound by its tolerance
        own = OWN if plan is None else self._own(state, plan.time[0] - self.layout.move_s)
        who = own if status in (Status.OK, Status.RETRIED) else status.name.lower()
        decision = Decision(inputs.copy(), status, who, by.seconds, by.message, plan)
        return replace(state, inputs=inputs), decision

    @staticmethod
    def _own(state: MpcState, time: float) -> str:
        return "probing" if state.probe is not None and time < state.probe.until - 1e-9 else OWN
