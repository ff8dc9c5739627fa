"""The value of knowledge in the objective: a detour is made where what it teaches is worth more than what it costs.

A plan's worth is what it earns, less what will be lost by acting on a wrong estimate:
``J - weight (sum over moves of move_s tr(H P_k) / 2 + lasts_s tr(H P_N) / 2)``. P_k is the covariance that the plan
leaves after k moves (`information.py`), H the loss (`stakes.py`), lasts_s the time for which the knowledge is of use.

The second part is not concave. A move up and a move down teach alike, so its slope is about zero at the plan that does
not probe, and no Newton step leaves that plan. So the plan is compared with detours: the first moves of one input are
held above or below where it is, and the rest is optimal again. Each detour is a solution of the same problem with
tighter bounds, verified like every plan, and the one of most worth is applied. It is planned anew at the next move: a
detour goes on as long as that pays.

Source: Feldbaum, Automation and Remote Control 21 (1960) 874; Heirung, Foss & Ydstie, Journal of Process Control 32
(2015) 64, for the covariance as a part of the objective.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Economics, Estimate, Limits
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.planner import Found
from controllers.economic_mpc.probing.information import Information
from controllers.economic_mpc.probing.stakes import Stakes
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.solvers.verification import NlpSolution, Solver, Validity
from controllers.economic_mpc.state import MpcState

WITHIN = 0.999
"""Share of the largest move that a detour asks for at most."""


class Knowledge:
    """Chooses between a plan and its detours.

    Parameters
    ----------
    setup
        Model, sampling interval and adapted parameters.
    problem, limits, economics
        Of the controller.
    noise_std
        Standard deviation of the noise of each measured output, by name, in its unit.
    lasts_s
        Time beyond the horizon for which knowledge is of use [s].
    weight
        Of what is lost by a wrong estimate; 0 for a controller that does not probe.
    walk
        Standard deviation of what each parameter changes in an hour, as a share of it.
    inputs
        Names of the inputs that make detours; default the first that the controller moves.
    lengths
        Moves that a detour lasts at least, one detour up and down for each.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        problem: OptimalControlProblem,
        limits: Limits,
        economics: Economics,
        *,
        noise_std: Mapping[str, float],
        lasts_s: float = 1800.0,
        weight: float = 1.0,
        walk: float = 0.0,
        inputs: Sequence[str] | None = None,
        lengths: Sequence[int] = (1, 5),
    ) -> None:
        layout = problem.layout
        inputs = layout.moved_names[:1] if inputs is None else tuple(inputs)
        for name in inputs:
            if name not in layout.moved_names:
                raise ModelError(
                    f"probing: {name!r} is no input that the controller moves; {near_match(name, layout.moved_names)}"
                )
        if not (lasts_s >= 0 and weight >= 0):
            raise ModelError("probing: lasts_s and weight must be at least 0")
        if not lengths or not all(1 <= length <= layout.horizon for length in lengths):
            raise ModelError(f"probing: lengths = {list(lengths)}; give some from 1 to {layout.horizon}, the horizon")
        self.layout, self.lasts_s, self.weight, self.lengths = layout, lasts_s, weight, tuple(lengths)
        self.information = Information(setup, layout, noise_std, walk)
        self.stakes = Stakes(setup, economics, layout)
        self._terms = FastCall(problem.terms)
        self._outputs = FastCall(problem.outputs, matrices=("outputs",))
        self._positions = [layout.moved_names.index(name) for name in inputs]
        self._ranges = np.array([limits.inputs[name] for name in layout.moved_names])
        self._largest = WITHIN * np.array([limits.moves[name] for name in layout.moved_names])

    def chosen(
        self, solver: Solver, state: MpcState, held: FloatArray, estimate: Estimate, found: Found, scale: float
    ) -> tuple[MpcState, Found]:
        """The plan or a detour, whichever is worth more.

        Parameters
        ----------
        solver
            Of the plan.
        state, held, estimate
            Of the controller, inputs now (nu,), and the newest estimate.
        found
            The plan, valid.
        scale
            Unit of the problem's prices in cu.
        """
        probe, free = state.probe, found.solution
        if probe is None or self.weight == 0 or not np.isfinite(estimate.covariance).all():
            return state, found
        hessian = self._hessian(free.variables, held, found.arguments)
        loss = self._loss(free.variables, held, estimate, found.arguments, hessian)
        if loss <= 0:
            return state, found
        best, worth, price, seconds = free, self._earned(free, found.arguments) / scale - loss, 0.0, free.seconds
        going_on = estimate.time < probe.until + self.layout.move_s - 1e-9
        for bounds in self._detours(held[self.layout.moved], found.bounds, going_on):
            tried = solver(found.arguments, bounds, free.variables, free.multipliers)
            seconds += tried.seconds
            if tried.validity is not Validity.VALID:
                continue
            earned = self._earned(tried, found.arguments) / scale
            after = earned - self._loss(tried.variables, held, estimate, found.arguments, hessian)
            if after > worth:
                best, worth = tried, after
                price = self._earned(free, found.arguments) / scale - earned
        found = replace(found, solution=replace(best, seconds=seconds))
        if best is free:
            return state, found
        spent = probe.spent + max(price, 0.0)
        probe = replace(probe, spent=spent, asked=max(price, 0.0), until=estimate.time + self.layout.move_s)
        return replace(state, probe=probe), found

    def _detours(self, moved: FloatArray, plain: dict[str, FloatArray], going_on: bool) -> list[dict[str, FloatArray]]:
        """Bounds of each detour that the ranges leave room for; one that goes on stays at least where it is."""
        found = []
        for i in self._positions:
            for side in (-1.0, 1.0):
                to = moved[i] if going_on else moved[i] + side * self._largest[i]
                if not self._ranges[i, 0] <= to <= self._ranges[i, 1]:
                    continue
                for length in self.lengths:
                    key = "ubx" if side < 0 else "lbx"
                    ends = plain[key].copy()
                    column = self.layout.chosen.start + i
                    self.layout.stages(ends)[:length, column] = to / self.layout.u_scale[i]
                    found.append(plain | {key: ends})
        return found

    def _earned(self, solution: NlpSolution, arguments: FloatArray) -> float:
        """The objective, in the problem's unit: what a plan earns less what its moves and slacks cost."""
        return float(self._terms(solution.variables, arguments)[0].sum())

    def _parameters(self, arguments: FloatArray) -> FloatArray:
        begin = len(self.layout.x_scale) + self.layout.inputs_size
        return arguments[begin : begin + len(self.layout.model.parameters)]

    def _hessian(self, plan: FloatArray, held: FloatArray, arguments: FloatArray) -> FloatArray:
        layout = self.layout
        begin = len(layout.x_scale) + layout.inputs_size + len(layout.model.parameters)
        begin += len(layout.model.inputs) - layout.inputs_size + 1
        limits = arguments[begin : begin + len(layout.output_limits)]
        return self.stakes(plan, self._outputs(plan, arguments)[0], limits, held, self._parameters(arguments))

    def _loss(
        self, plan: FloatArray, held: FloatArray, estimate: Estimate, arguments: FloatArray, hessian: FloatArray
    ) -> float:
        """What will be lost by a wrong estimate after this plan [cu]."""
        covariances = self.information(
            plan,
            held,
            self._parameters(arguments),
            estimate.parameters,
            estimate.covariance,
            (estimate.time, estimate.state),
        )
        rates = np.einsum("ij,kji->k", hessian, covariances) / 2
        return float(self.weight * (self.layout.move_s * rates[:-1].sum() + self.lasts_s * rates[-1]))
