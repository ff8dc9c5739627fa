"""Real-time iterations: one Newton step of sequential quadratic programming a move, from the plan of the move before.

Diehl, Bock and Schloeder (2005), SIAM J. Control Optim. 43(5): the plan follows the optimum as the state changes, and
is not brought to it at any one time. What a step leaves of the equations is verified like every solution; where the
plan was moved too far for one step, further ones follow.

The quadratic programme is condensed to the inputs (`condensing.py`), where its Hessian is the one that matters: only
directions that the equations allow are made convex, by reflecting negative eigenvalues. A dense active-set method
(DAQP) then takes less time than one iteration of an interior point method on the stages.
"""

from __future__ import annotations

import time

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.fastcall import FastCall
from controllers.economic_mpc.collocation import OptimalControlProblem
from controllers.economic_mpc.condensing import Condensed, LinearisedStages
from controllers.economic_mpc.derivatives import Derivatives
from controllers.economic_mpc.layout import Multipliers
from controllers.economic_mpc.verification import NlpSolution, Solver, Validity, Verifier, no_solution

MOST_STEPS = 4
LEAST_CURVATURE = 1e-3
"""Of the objective by a scaled input, and by a slack that has none: the programme must be strictly convex."""
UNBOUNDED = 1e9
RESULTS = ("lines", "jacobian", "gradient", "hessian")
"""Of `Derivatives.together`."""


class RealTimeIteration:
    """Newton steps on one problem; a cold start is left to a complete solver.

    Parameters
    ----------
    problem
        The NLP.
    cold
        Solver of cold starts.
    """

    def __init__(self, problem: OptimalControlProblem, cold: Solver) -> None:
        self.problem, self.layout, self._cold = problem, problem.layout, cold
        self._derivatives = Derivatives(problem)
        self._linearise = FastCall(self._all(), matrices=RESULTS)
        self._inequalities = np.hstack([self.layout.rows[kind] for kind in ("moves", "outputs", "states")])
        size, rows = self.layout.horizon * (self.layout.inputs_size + self.layout.slacks_size), self._inequalities.size
        dense = {"h": ca.Sparsity.dense(size, size), "a": ca.Sparsity.dense(rows, size)}
        self._programme = FastCall(ca.conic("rti", "daqp", dense))
        self._verify = Verifier(problem)

    def _all(self) -> ca.Function:
        x, p = self.problem.nlp["x"], self.problem.nlp["p"]
        lam = ca.MX.sym("lam", self.problem.nlp["g"].numel())
        layout, begin = self.layout, self.problem.begin
        stages, after = self.problem.split(x)
        multipliers = ca.reshape(lam[layout.stage_rows.ravel().tolist()], -1, layout.horizon)
        results = list(self._derivatives.together()(stages, after, begin, p, 1.0, multipliers))
        initial = self.problem.initial(x, p)
        return ca.Function("all", [x, p, lam], [initial, *results], ["x", "p", "lam"], ["initial", *RESULTS])

    def __call__(
        self,
        arguments: FloatArray,
        bounds: dict[str, FloatArray],
        start: FloatArray,
        multipliers: Multipliers | None = None,
    ) -> NlpSolution:
        """One step from a start (n,) and its multipliers, more where the equations ask for it; see `Solver`."""
        if multipliers is None:
            return self._cold(arguments, bounds, start)
        if not (np.isfinite(arguments).all() and np.isfinite(start).all()):
            return no_solution(len(start), len(bounds["lbg"]), "state or estimate is not finite")
        begin, x, lam, steps = time.perf_counter(), start, multipliers, 0
        validity, message = Validity.VIOLATED, ""
        while validity is Validity.VIOLATED and steps < MOST_STEPS:
            try:
                x, lam = self._step(x, arguments, bounds, lam[1])
            except np.linalg.LinAlgError as error:  # NaN, or equations that can not be solved for their points
                return no_solution(len(start), len(bounds["lbg"]), str(error), time.perf_counter() - begin)
            steps += 1
            validity, message = self._verify(x, arguments, bounds)
        return NlpSolution(x, lam, validity, message, steps, time.perf_counter() - begin, "rti")

    def _step(
        self, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray], lam: FloatArray
    ) -> tuple[FloatArray, Multipliers]:
        layout = self.layout
        small = Condensed(layout, self._linearised(x, arguments, lam))
        stage = layout.stages(x)[:, layout.chosen]
        box = [self._inputs_first(layout.stages(bounds[key])[:, layout.chosen] - stage) for key in ("lbx", "ubx")]
        lines = [bounds[key][self._inequalities].ravel() - small.offsets for key in ("lbg", "ubg")]
        limits = (np.clip(b, -UNBOUNDED, UNBOUNDED) for b in (*lines, *box))
        gradient = np.concatenate([small.gradient, small.slack_gradient])
        nothing = np.zeros_like(gradient), np.zeros_like(gradient), np.zeros(len(small.rows)), *[np.zeros((0, 0))] * 2
        change, _, of_rows, of_box = self._programme(_convex(small), gradient, small.rows, *limits, *nothing)
        dw, last = small.change(change)
        new = x.copy()
        layout.stages(new)[:] += dw
        new[layout.horizon * layout.block :] += last
        of_constraints, of_bounds = np.zeros(len(lam)), np.zeros(len(x))
        of_constraints[layout.stage_rows], of_constraints[layout.rows["initial"][0]] = small.multipliers(dw, of_rows)
        inputs, slacks = (
            part.reshape(layout.horizon, -1) for part in np.split(of_box, [layout.horizon * layout.inputs_size])
        )
        layout.stages(of_bounds)[:, layout.chosen] = np.hstack([inputs, slacks])
        return new, (of_bounds, of_constraints)

    def _linearised(self, x: FloatArray, arguments: FloatArray, lam: FloatArray) -> LinearisedStages:
        layout, of = self.layout, self._derivatives
        initial, lines, jacobian, gradient, hessian = self._linearise(x, arguments, lam)
        J = np.zeros((layout.horizon, layout.stage_rows.shape[1], layout.block))
        J[:, of.jacobian_pattern.rows, of.jacobian_pattern.columns] = jacobian.T
        H = np.zeros((layout.horizon, layout.block, layout.block))
        H[:, of.hessian_pattern.rows, of.hessian_pattern.columns] = hessian.T
        return LinearisedStages(lines.T, J, initial, gradient.T, H)

    def _inputs_first(self, chosen: FloatArray) -> FloatArray:
        """Inputs of all stages, then slacks of all stages, from both of each stage (K, inputs + slacks)."""
        m = self.layout.inputs_size
        return np.concatenate([chosen[:, :m].ravel(), chosen[:, m:].ravel()])


def _convex(small: Condensed) -> FloatArray:
    """Hessian of inputs and slacks, its negative eigenvalues reflected: a downward curve is a curve, too."""
    values, axes = np.linalg.eigh(small.hessian)
    free = len(values)
    of_slacks = np.maximum(small.slack_hessian, LEAST_CURVATURE)
    hessian = np.diag(np.concatenate([np.zeros(free), of_slacks]))
    hessian[:free, :free] = (axes * np.maximum(np.abs(values), LEAST_CURVATURE)) @ axes.T
    return hessian
