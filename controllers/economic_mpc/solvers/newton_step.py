"""The Newton step of one plan.

The quadratic programme is condensed to the inputs (`condensing.py`), where its Hessian is the one that matters: only
directions that the equations allow are made convex, by reflecting negative eigenvalues. A dense active-set method
(DAQP) then takes less time than one iteration of an interior point method on the stages.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.linalg import eigh

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.condensing import Condensed, LinearisedStages
from controllers.economic_mpc.problem.derivatives import Derivatives
from controllers.economic_mpc.problem.layout import Multipliers, StageLayout

LEAST_CURVATURE = 1e-3
"""Of the objective by a scaled input, and by a slack that has none: the programme must be strictly convex."""
UNBOUNDED = 1e9
RESULTS = ("lines", "jacobian", "gradient", "hessian")
"""Of `Derivatives.together`."""


class PlanStep:
    """Newton steps of a problem; see `NewtonStep`."""

    def __init__(self, problem: OptimalControlProblem) -> None:
        self.problem, self.layout = problem, problem.layout
        self._derivatives = Derivatives(problem)
        self._linearise = FastCall(self._all(), matrices=RESULTS)
        self._inequalities = self.layout.inequalities
        size, rows = self.layout.horizon * (self.layout.inputs_size + self.layout.slacks_size), self._inequalities.size
        self._programme = Programme(size, rows)

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
        self, x: FloatArray, arguments: FloatArray, bounds: dict[str, FloatArray], lam: FloatArray
    ) -> tuple[FloatArray, Multipliers]:
        """Variables and multipliers one step later."""
        layout = self.layout
        initial, *results = self._linearise(x, arguments, lam)
        small = Condensed(layout, LinearisedStages.of(layout, self._derivatives, initial, results))
        stage = layout.stages(x)[:, layout.chosen]
        box = [inputs_first(layout, layout.stages(bounds[key])[:, layout.chosen] - stage) for key in ("lbx", "ubx")]
        limits = [bounds[key][self._inequalities].ravel() - small.offsets for key in ("lbg", "ubg")]
        gradient = np.concatenate([small.gradient, small.slack_gradient])
        change, of_rows, of_box = self._programme(convex(small), gradient, small.rows, limits, box)
        dw = small.change(change)
        new = x.copy()
        layout.stages(new)[:] += dw
        new[layout.horizon * layout.block :] += small.last(dw)
        of_constraints, of_bounds = np.zeros(len(lam)), np.zeros(len(x))
        of_constraints[layout.stage_rows], of_constraints[layout.rows["initial"][0]] = small.multipliers(dw, of_rows)
        inputs, slacks = (
            part.reshape(layout.horizon, -1) for part in np.split(of_box, [layout.horizon * layout.inputs_size])
        )
        layout.stages(of_bounds)[:, layout.chosen] = np.hstack([inputs, slacks])
        return new, (of_bounds, of_constraints)


class Programme:
    """A dense convex quadratic programme of n variables and m rows, solved by DAQP."""

    def __init__(self, size: int, rows: int) -> None:
        dense = {"h": ca.Sparsity.dense(size, size), "a": ca.Sparsity.dense(rows, size)}
        self._solve = FastCall(ca.conic("rti", "daqp", dense))
        self._nothing = np.zeros(size), np.zeros(size), np.zeros(rows), *[np.zeros((0, 0))] * 2

    def __call__(
        self,
        hessian: FloatArray,
        gradient: FloatArray,
        rows: FloatArray,
        limits: list[FloatArray],
        box: list[FloatArray],
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Minimiser (n,), and multipliers of rows (m,) and box (n,); both ends of each are given."""
        ends = (np.clip(b, -UNBOUNDED, UNBOUNDED) for b in (*limits, *box))
        change, _, of_rows, of_box = self._solve(hessian, gradient, rows, *ends, *self._nothing)
        return change, of_rows, of_box


def inputs_first(layout: StageLayout, chosen: FloatArray) -> FloatArray:
    """Inputs of all stages, then slacks of all stages, from both of each stage (K, inputs + slacks)."""
    m = layout.inputs_size
    return np.concatenate([chosen[:, :m].ravel(), chosen[:, m:].ravel()])


def convex(small: Condensed) -> FloatArray:
    """Hessian of inputs and slacks, its negative eigenvalues reflected: a downward curve is a curve, too."""
    free = len(small.hessian)
    hessian = np.diag(np.concatenate([np.zeros(free), np.maximum(small.slack_hessian, LEAST_CURVATURE)]))
    hessian[:free, :free] = reflected(small.hessian)
    return hessian


def reflected(hessian: FloatArray) -> FloatArray:
    """Symmetric matrices (..., n, n), their negative eigenvalues reflected and the small ones raised."""
    if hessian.ndim == 2:  # SciPy's routine for small matrices: NumPy's starts threads, for ten times the time
        values, axes = eigh(hessian, driver="ev", check_finite=False)
    else:
        values, axes = np.linalg.eigh(hessian)
    raised = np.maximum(np.abs(values), LEAST_CURVATURE)
    return np.asarray((axes * raised[..., None, :]) @ axes.swapaxes(-1, -2))
