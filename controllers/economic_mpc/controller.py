"""Economic model predictive control that reads the newest estimate and never applies an input it has not checked."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyController, ControllerSetup, Decision, Estimate, Sample, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.early import Early, counted, narrowed
from controllers.economic_mpc.modifiers.learning import Modifiers, answer_time, modifier_options
from controllers.economic_mpc.output_bias import OutputBias
from controllers.economic_mpc.planner import Planner, Uncertainty
from controllers.economic_mpc.probing.choice import make_probing, probed
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.layout import Bounds
from controllers.economic_mpc.scenarios import Misfit
from controllers.economic_mpc.softening import Softening
from controllers.economic_mpc.solvers.nlp_solvers import FailingSolver, make_solver
from controllers.economic_mpc.solvers.verification import NlpSolution, Solver, Validity
from controllers.economic_mpc.state import MpcState, ProbeState
from controllers.economic_mpc.taking_over import taken_over
from controllers.economic_mpc.told import Teller, Told

OWN = "economic_mpc"


class EconomicMpc:
    """Moves inputs for the best economic value within the limits of outputs and states.

    What is earned is the economics' matter (`ControllerSetup.economics`), what is moved and limited that of
    `ControllerSetup.limits`.

    Every `move_s` seconds an optimal control problem over `horizon` moves is solved from the newest estimate
    (`collocation.py`). A solution is applied only if it is finite, within its bounds and meets the constraints. Else
    one cold start is tried, then the plan of the step before goes on. Then the inputs are held, and at last the first
    planned inputs are applied. `Decision` says which.

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
        Cost of a second at a tenth of its scale beyond the limit of an output [cu]; of a state: its square. Default the
        typical rate of a second: large, so the limit is soft, but exact.
    backoff
        Kept from the limits of outputs, in their units: what changes between two moves, and what the estimate is off
        by. Default a hundredth of each output's scale.
    limit_probability
        Probability with which the limits of outputs are to hold, given the covariance of the estimate: they are backed
        off further by what that asks (`chance_constraint.py`). Default no further back-off.
    scenarios
        Number of scenarios, 1, 3, 9 or 27, in which the first move has to keep the limits (`scenarios.py`). The outer
        ones lie where `limit_probability` (0.95 by default) puts them; limits are not backed off for it.
    branch
        Moves that scenarios look ahead, beside the nominal one; default 5, or the horizon if that is less.
    priority
        Names of the limited outputs and states, the one to give up last first. Where no plan keeps every limit, they
        are given up from the back (`softening.py`). Default: outputs, then states.
    bias_time_s
        Time constant of the filters of output biases [s].
    budget_s
        Wall-clock time of a solve; there is no second try when the first took longer.
    early_plans
        Plan before the next move is due where an output has left its plan and lies beyond its limit (`early.py`).
    modifiers
        Correct the model's outputs in limits and economics by biases and slopes of the plant (`modifiers/learning.py`).
        True, or options of `Modifiers` (`settling_s` by default the horizon); default none.
    probing
        Moves that tell the parameters apart: options of `Probing` (dips within a budget), or `by: value` and options of
        `Knowledge` (what a detour teaches is worth more than it costs); default none.

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
        scenarios: int = 1,
        branch: int | None = None,
        priority: Sequence[str] | None = None,
        bias_time_s: float = 20.0,
        budget_s: float = 5.0,
        early_plans: bool = False,
        modifiers: bool | Mapping[str, Any] = False,
        probing: Mapping[str, Any] | None = None,
    ) -> None:
        limits, economics = setup.limits, setup.economics
        if limits is None or economics is None:
            raise ModelError("economic_mpc needs limits and economics; give both (in a scenario: keys of that name)")
        if horizon < 1 or not move_s >= setup.dt or not budget_s > 0 or not bias_time_s > 0:
            raise ModelError("economic_mpc: horizon, move_s, bias_time_s and budget_s must be positive, move_s >= dt")
        if not limits.inputs or set(limits.inputs) != set(limits.moves):
            raise ModelError(
                f"economic_mpc: limits have ranges of {list(limits.inputs)} and largest moves of {list(limits.moves)}; "
                "give both for each input that is to be moved"
            )
        if probing is not None and scenarios != 1:
            raise ModelError("economic_mpc: probing compares nominal plans; give it or scenarios, not both")
        self.setup = setup
        asked = modifier_options(modifiers, horizon * move_s)
        answer_s = None if asked is None else answer_time(asked["settling_s"])
        self.problem = OptimalControlProblem(setup.model, economics, limits, horizon, move_s, answer_s=answer_s)
        self.layout = self.problem.layout
        self.solver: Solver = make_solver(self.problem, solver, budget_s)
        self.budget_s = budget_s
        own = [economics.typical_rate if cost is None else cost for cost in (move_cost, limit_penalty)]
        own = [own[0], *[own[1]] * self.layout.slacks_size]
        self._scale = 1 / economics.typical_rate  # the objective is of order 1 to 100, as solvers want it
        self._bounds = Bounds.of(limits, self.layout)
        self.modifiers = None if asked is None else Modifiers(setup, self.layout, bias_time_s, **asked)
        self.planner = Planner(
            setup,
            self.problem,
            self._bounds,
            limits=self.layout.limit_values(backoff),
            prices=self._scale * np.array([*economics.prices(), *own]),
            softening=Softening(self.problem, self._bounds, priority, budget_s),
            uncertainty=Uncertainty(limit_probability, scenarios, branch),
            solver=solver,
            budget_s=budget_s,
            modifiers=self.modifiers,
        )
        self._biases = [
            OutputBias(name, setup.model.index("outputs", name), setup.dt, bias_time_s) for name in self.layout.outputs
        ]
        self.early = Early(self.layout, self.planner.limits) if early_plans else None
        self.probing = None if probing is None else make_probing(setup, self.problem, limits, economics, probing)
        self._tell = Teller(self.problem)

    def init(self, time: float) -> MpcState:
        """Nothing is planned yet."""
        count, probe = len(self._biases), None if self.probing is None else ProbeState(time)
        state = MpcState(0, time, None, None, None, 0, (0.0,) * count, (time,) * count, Misfit.none(count), probe)
        return state if self.modifiers is None else replace(state, modifiers=self.modifiers.init(time))

    def with_failing_solver(self) -> EconomicMpc:
        """The same controller, states included, whose optimisations find nothing: a drill of what decides then."""
        drill = copy.copy(self)
        drill.solver, drill.planner = FailingSolver(), self.planner.without_tree()
        return drill

    def take_over(
        self, before: AnyController, state: MpcState, known: Sequence[Estimate], again: Sequence[Estimate]
    ) -> MpcState:
        """Go on with the inputs and the plan of the same controller for a smaller model; see `TakesOver.take_over`."""
        if not isinstance(before, EconomicMpc):
            raise ModelError("economic_mpc: only the state of an economic_mpc can be taken over")
        after = taken_over(state, before.layout, self.layout, self._biases, known, again)
        if self.modifiers is None or state.modifiers is None:
            return after
        return replace(after, modifiers=self.modifiers.taken_over(state.modifiers, known, again))

    def tracked(self, state: MpcState, inputs: FloatArray) -> MpcState:
        """Go on from what really acts; see `TracksInputs.tracked`."""
        return replace(state, inputs=inputs.copy())

    def decide(self, state: MpcState, sample: Sample | None, estimate: Estimate | None) -> tuple[MpcState, Decision]:
        """Inputs of the next interval: the planned ones until there is an estimate, then the optimiser's."""
        state, came = self._listen(replace(state, row=state.row + 1), estimate)
        if self.modifiers is not None and state.modifiers is not None:
            state = replace(state, modifiers=self.modifiers.heard(state.modifiers, sample, estimate))
        if sample is None or estimate is None:
            row = min(state.row, len(self.setup.schedule)) - 1
            inputs = self.setup.schedule[row].copy()
            return replace(state, inputs=inputs), Decision(inputs.copy(), Status.OK, "schedule")
        held = sample.inputs.copy()  # the newest of the disturbances
        if state.inputs is not None:
            held[self.layout.moved] = state.inputs[self.layout.moved]
        in_time = sample.time >= state.due - 1e-9
        if not in_time and not (self.early is not None and self.early.is_due(state, came)):
            return replace(state, inputs=held.copy()), Decision(held.copy(), Status.OK, self._own(state, sample.time))
        due, bounds, moved = max(state.due, sample.time) if in_time else sample.time, None, held[self.layout.moved]
        if not in_time and state.moved_from is not None:
            bounds = narrowed(self.planner.bounds, self.layout, moved, state.moved_from)
            state = replace(state, misfit=counted(state.misfit, sample.time, came))
        kept = in_time and self.early is not None and self.early.may_follow(came)
        state = replace(state, due=due + self.layout.move_s, moved_from=moved if kept else None)
        return self._optimise(state, held, sample, estimate, bounds)

    def _listen(self, state: MpcState, estimate: Estimate | None) -> tuple[MpcState, FloatArray]:
        """Filtered biases, and limited outputs as they are now (k,), free of most of the noise."""
        if estimate is None:
            return state, np.full(len(self._biases), np.nan)
        filters = zip(self._biases, state.bias, state.heard, strict=True)
        after = [own.after(bias, heard, estimate) for own, bias, heard in filters]
        bias = tuple(bias for bias, _ in after)
        came = np.array([own.corrected(estimate, value) for own, value in zip(self._biases, bias, strict=True)])
        misfit = state.misfit.after(estimate.time, came, self.setup.dt)
        return replace(state, bias=bias, heard=tuple(heard for _, heard in after), misfit=misfit), came

    def _optimise(
        self,
        state: MpcState,
        held: FloatArray,
        sample: Sample,
        estimate: Estimate,
        bounds: dict[str, FloatArray] | None,
    ) -> tuple[MpcState, Decision]:
        moved = self.layout.moved
        found = self.planner.find(self.solver, state, held, sample, estimate, bounds)
        if found.solution.validity is Validity.VALID and self.probing is not None and not found.given_up:
            state, found = probed(self.probing, self.solver, self.problem, state, held, estimate, found, self._scale)
        solution = found.solution
        if solution.validity is Validity.VALID:
            told = self._tell(estimate.time, found)
            misfit = state.misfit.planned(told.plan, self.layout.outputs)
            kept = solution.multipliers if found.tree is None else None
            plan = replace(state, plan=solution.variables, multipliers=kept, age=0, misfit=misfit, tree=found.tree)
            first = self.layout.inputs_of(solution.variables)[0]
            return self._apply(plan, held, first, found.status, solution, told)
        if state.plan is not None and state.age + 1 < self.layout.horizon:
            older = replace(state, age=state.age + 1)
            planned = self.layout.inputs_of(state.plan)[older.age]
            return self._apply(older, held, planned, Status.SHIFTED_PLAN, solution)
        if np.isfinite(held).all():
            return self._apply(state, held, held[moved], Status.HELD, solution)
        return self._apply(state, self.setup.schedule[0], self.setup.schedule[0][moved], Status.SAFE_INPUT, solution)

    def _apply(
        self,
        state: MpcState,
        held: FloatArray,
        to: FloatArray,
        status: Status,
        by: NlpSolution,
        told: Told | None = None,
    ) -> tuple[MpcState, Decision]:
        inputs = held.copy()
        low, high = self._bounds.inputs.T
        inputs[self.layout.moved] = np.clip(to, low, high)  # a valid solution may miss a bound by its tolerance
        if told is None:
            decision = Decision(inputs.copy(), status, status.name.lower(), by.seconds, by.message)
        else:
            who = self._own(state, told.plan.time[0] - self.layout.move_s)
            decision = Decision(inputs.copy(), status, who, by.seconds, told.words, told.plan, softened=told.softened)
        return replace(state, inputs=inputs), decision

    @staticmethod
    def _own(state: MpcState, time: float) -> str:
        return "probing" if state.probe is not None and time < state.probe.until - 1e-9 else OWN
