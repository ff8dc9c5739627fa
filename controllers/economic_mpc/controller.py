"""Economic model predictive control that reads the newest estimate and never applies an input it has not checked."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

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
from controllers.economic_mpc.chance_constraint import ChanceConstraint
from controllers.economic_mpc.collocation import OptimalControlProblem
from controllers.economic_mpc.layout import Bounds, with_further_states
from controllers.economic_mpc.nlp_solvers import FailingSolver, make_solver
from controllers.economic_mpc.output_bias import OutputBias
from controllers.economic_mpc.probing import ProbeState, Probing, price
from controllers.economic_mpc.stage import Arguments
from controllers.economic_mpc.state import MpcState
from controllers.economic_mpc.verification import NlpSolution, Solver, Validity

OWN = "economic_mpc"


class EconomicMpc:
    """Moves inputs for the best economic value within the limits of outputs and states.

    It knows nothing of the process: what is earned is the economics' matter (`ControllerSetup.economics`), and what is
    moved and limited that of `ControllerSetup.limits`.

    Every `move_s` seconds an optimal control problem over `horizon` moves is solved from the estimated state with the
    newest parameter estimate (`collocation.py`). A solution is applied only if it is finite, within its bounds and
    meets the constraints. Else one cold start is tried, then the plan of the step before goes on. Then the inputs are
    held, and at last the first planned inputs are applied. `Decision` says which.

    Parameters
    ----------
    setup
        Model, schedule, adapted parameters, limits and economics.
    horizon
        Number of moves looked ahead.
    move_s
        Length of a move [s], a multiple of the sampling interval.
    solver
        `ipopt`, `fatrop` or `rti`.
    move_cost
        Cost of a move by the whole scale of an input, squared [cu]; default the typical rate of a second.
    limit_penalty
        Cost of a second at a tenth of its scale beyond the limit of an output [cu]; of a state: its square. Large: the
        limit is soft, but exact. Default the typical rate of a second.
    backoff
        Kept from the limits of outputs, in their units: what changes between two moves, and what the estimate is off
        by. Default a hundredth of each output's scale.
    limit_probability
        Probability with which the limits of outputs are to hold, given the covariance of the estimate: they are backed
        off further by what that asks (`chance_constraint.py`). Default no further back-off.
    bias_time_s
        Time constant of the filters of output biases [s].
    budget_s
        Wall-clock time of a solve; there is no second try when the first took longer.
    probing
        Options of `Probing`: dips of an input that tell the parameters apart; default none.

    Raises
    ------
    ModelError
        Limits or economics are missing or name what the model lacks, or an option is outside its range.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        *,
        horizon: int = 20,
        move_s: float = 30.0,
        solver: str = "ipopt",
        move_cost: float | None = None,
        limit_penalty: float | None = None,
        backoff: float | None = None,
        limit_probability: float | None = None,
        bias_time_s: float = 20.0,
        budget_s: float = 5.0,
        probing: Mapping[str, Any] | None = None,
    ) -> None:
        limits, economics = setup.limits, setup.economics
        if limits is None or economics is None:
            raise ModelError(
                "economic_mpc needs limits and economics; give both (in a scenario: the keys of that name)"
            )
        if horizon < 1 or not move_s >= setup.dt or not budget_s > 0 or not bias_time_s > 0:
            raise ModelError("economic_mpc: horizon, move_s, bias_time_s and budget_s must be positive, move_s >= dt")
        if not limits.inputs or set(limits.inputs) != set(limits.moves):
            raise ModelError(
                f"economic_mpc: limits have ranges of {list(limits.inputs)} and largest moves of {list(limits.moves)}; "
                "give both for each input that is to be moved"
            )
        self.setup = setup
        self.problem = OptimalControlProblem(setup.model, economics, limits, horizon, move_s)
        self.layout = self.problem.layout
        self.solver: Solver = make_solver(self.problem, solver, budget_s)
        self.budget_s = budget_s
        self._limits = self.layout.limit_values(backoff)
        self._chance: ChanceConstraint | None = None
        if limit_probability is not None:
            self._chance = ChanceConstraint(setup, [e.index for e in self.layout.output_limits], limit_probability)
        own = [economics.typical_rate if cost is None else cost for cost in (move_cost, limit_penalty)]
        self._value_scale = 1 / economics.typical_rate  # the objective is of order 1 to 100, as solvers want it
        self._prices = self._value_scale * np.array([*economics.prices(), *own])
        self._bounds = Bounds.of(limits, self.layout)
        self._solver_bounds = self.layout.bounds(self._bounds)
        self._biases = [
            OutputBias(name, setup.model.index("outputs", name), setup.dt, bias_time_s) for name in self.layout.outputs
        ]
        self.probing = None if probing is None else Probing(self.layout, limits, **probing)
        self._ode = FastCall(setup.model.ode)
        self._outputs = FastCall(self.problem.outputs, matrices=("outputs",))

    def init(self, time: float) -> MpcState:
        """Nothing is planned yet."""
        unheard = (time,) * len(self._biases)
        probe = None if self.probing is None else ProbeState(time)
        return MpcState(0, time, None, None, None, 0, (0.0,) * len(self._biases), unheard, probe)

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
        bias = tuple(b + own.change(known, again) for b, own in zip(state.bias, self._biases, strict=True))
        state = replace(state, bias=bias)
        if state.plan is None or len(self.setup.model.states) == len(before.setup.model.states):
            return state
        plan = with_further_states(state.plan, before.layout, self.layout, again[-1].state)
        return replace(state, plan=plan, multipliers=None)

    def tracked(self, state: MpcState, inputs: FloatArray) -> MpcState:
        """Go on from what really acts; see `TracksInputs.tracked`."""
        return replace(state, inputs=inputs.copy())

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
        filters = zip(self._biases, state.bias, state.heard, strict=True)
        after = [own.after(bias, heard, estimate) for own, bias, heard in filters]
        return replace(state, bias=tuple(bias for bias, _ in after), heard=tuple(heard for _, heard in after))

    def _optimise(
        self, state: MpcState, held: FloatArray, sample: Sample, estimate: Estimate
    ) -> tuple[MpcState, Decision]:
        model, moved = self.setup.model, self.layout.moved
        theta = full_parameters(model, self.setup.parameters, estimate.parameters, sample.parameters)
        others = np.delete(held, moved)
        now = Arguments(
            estimate.state,
            held[moved],
            theta,
            others,
            self._limits_for(estimate, held, theta),
            np.array(state.bias),
            self._prices,
            estimate.time,
        ).vector()
        solution, status = self._solve(state, now, held, estimate, theta)
        if solution.validity is Validity.VALID and self.probing is not None:
            state, solution = self._probe(self.probing, state, now, held, estimate, solution)
        if solution.validity is Validity.VALID:
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

    def _limits_for(self, estimate: Estimate, held: FloatArray, theta: FloatArray) -> FloatArray:
        """Values of the output limits, moved inwards by what the estimate leaves open."""
        if self._chance is None:
            return self._limits
        kept = self._chance.backoff(estimate.time, estimate.state, held, theta, estimate.covariance)
        inwards = np.array([-1.0 if e.is_upper else 1.0 for e in self.layout.output_limits])
        return self._limits + inwards * kept

    def _solve(
        self, state: MpcState, now: FloatArray, held: FloatArray, estimate: Estimate, theta: FloatArray
    ) -> tuple[NlpSolution, Status]:
        """Warm from the last plan, then once cold."""
        z = self._ode(estimate.time, estimate.state, held, theta)[3]
        cold = self.layout.start(estimate.state, held[self.layout.moved], z)
        if state.plan is None or state.age > 0:  # what is left of a plan from before a failure is no start
            return self.solver(now, self._solver_bounds, cold), Status.OK
        shifted = self.layout.shifted(state.plan)
        multipliers = self.layout.shifted_multipliers(state.multipliers) if state.multipliers else None
        solution = self.solver(now, self._solver_bounds, shifted, multipliers)
        if solution.validity is Validity.VALID or solution.seconds > self.budget_s:
            return solution, Status.OK
        return self.solver(now, self._solver_bounds, cold), Status.RETRIED

    def _probe(
        self,
        probing: Probing,
        state: MpcState,
        now: FloatArray,
        held: FloatArray,
        estimate: Estimate,
        free: NlpSolution,
    ) -> tuple[MpcState, NlpSolution]:
        """Put a dip in front of a valid plan where one is due, has a valid plan itself, and can be paid."""
        probe, value = state.probe, float(held[self.layout.moved[probing.position]])
        if probe is None or not probing.is_due(probe, estimate, value):
            return state, free
        bounds = probing.bounds(value, self._solver_bounds)
        asked = self.solver(now, bounds, free.variables, free.multipliers)
        if asked.validity is not Validity.VALID:
            return state, free
        cost = price(self.problem, free.variables, asked.variables, now) / self._value_scale
        probe, paid = probing.pay(probe, cost, estimate.time)
        return replace(state, probe=probe), replace(asked, seconds=free.seconds + asked.seconds) if paid else free

    def _plan(self, time: float, solution: NlpSolution, now: FloatArray) -> Plan:
        inputs = self.layout.inputs_of(solution.variables)
        ends = time + self.layout.move_s * np.arange(1.0, self.layout.horizon + 1)
        (outputs,) = self._outputs(solution.variables, now)
        moves = dict(zip(self.layout.moved_names, inputs.T, strict=True))
        return Plan(ends, moves, dict(zip(self.layout.outputs, outputs.T, strict=True)))

    def _apply(
        self,
        state: MpcState,
        held: FloatArray,
        to: FloatArray,
        status: Status,
        by: NlpSolution,
        plan: Plan | None = None,
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
