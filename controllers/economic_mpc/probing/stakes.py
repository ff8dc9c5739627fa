"""What is lost by acting on a wrong estimate, at the steady state that a plan goes to.

V(u, theta) is the value rate of a steady state, g(u, theta) are the limited outputs that are at their limits there. The
Lagrangian is ``L = V + lambda' g``. Inputs at an end of their range stay. Z spans the moves of the others that keep the
outputs at their limits: only these depend on what is known. A controller that takes theta + d for theta is off by
``Z M^-1 N d`` with ``M = -Z' L_uu Z`` and ``N = Z' L_utheta``. It loses ``d' H d / 2`` with ``H = N' M^-1 N``. Where as
many limits are active as inputs are moved, Z is empty. Nothing is lost then: feedback finds the limits.

Source: Forbes & Marlin, Computers & Chemical Engineering 20 (1996) 717 (design cost); Nocedal & Wright, Numerical
Optimization (2006), section 12.5, for the reduced Hessian.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.linalg import null_space

from adaptive_flot.contracts import ControllerSetup, Economics, OperatingPoint
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from controllers.economic_mpc.problem.layout import StageLayout

STEP = 0.01
"""Of the differences: a share of each input's and each parameter's value."""
AT_END, AT_LIMIT = 0.01, 0.1
"""What counts as at an end of a range, as a share of the range; and at a limit, in units of its slack."""


class Stakes:
    """The matrix H of a loss.

    Parameters
    ----------
    setup
        Model and adapted parameters (q).
    economics
        What is earned.
    layout
        Of the plans; its ranges and limits.
    """

    def __init__(self, setup: ControllerSetup, economics: Economics, layout: StageLayout) -> None:
        self.layout = layout
        self._model = setup.model
        self._adapted = setup.model.indices("parameters", setup.parameters)
        self._slopes = FastCall(self._written(economics), matrices=("slopes",))
        self._ranges = np.array([layout.limits.inputs[name] for name in layout.moved_names])

    def _written(self, economics: Economics) -> ca.Function:
        """(x, u, p) -> slopes (1 + k, m) of value rate and limited outputs by the moved inputs, at steady state."""
        model, layout = self._model, self.layout
        x, u, p = (ca.SX.sym(name, len(getattr(model, name))) for name in ("states", "inputs", "parameters"))
        true = without_sensor_effects(model)
        rates = model.ode(0.0, x, u, p)[0]
        own = model.indices("states", true.names("states")), model.indices("parameters", true.names("parameters"))
        outputs = true.ode(0.0, x[own[0]], u, p[own[1]])[1]
        earned = economics.rates(OperatingPoint(model, x, u, outputs, p), list(economics.prices()))
        limited = outputs[model.indices("outputs", layout.outputs)]
        what = ca.vertcat(sum(earned.values()), limited)
        by_x, by_u = ca.jacobian(what, x), ca.jacobian(what, u)[:, layout.moved]
        state_by_u = -ca.solve(ca.jacobian(rates, x), ca.jacobian(rates, u)[:, layout.moved])
        return ca.Function("slopes", [x, u, p], [by_u + by_x @ state_by_u], ["x", "u", "p"], ["slopes"])

    def __call__(
        self, plan: FloatArray, came: FloatArray, limits: FloatArray, u: FloatArray, p: FloatArray
    ) -> FloatArray:
        """H (q, q), cu/s by the parameters' units squared; zero where nothing is lost, or without a steady state.

        Parameters
        ----------
        plan
            Variables (n,): the steady state is that of its inputs halfway.
        came
            Limited outputs at the end of each move (horizon, k), as planned.
        limits
            Values of the output limits, with the distance that is kept.
        u, p
            Inputs (nu,) and parameters (np,) now.
        """
        layout, q = self.layout, len(self._adapted)
        half = layout.horizon // 2
        inputs = u.copy()
        inputs[layout.moved] = moved = layout.inputs_of(plan)[half]
        low, high = self._ranges.T
        free = np.flatnonzero((moved - low > AT_END * (high - low)) & (high - moved > AT_END * (high - low)))
        active = sorted(
            {
                1 + layout.outputs.index(end.output)
                for end, limit, unit in zip(layout.output_limits, limits, layout.output_slack_scale, strict=True)
                if abs(came[half, layout.outputs.index(end.output)] - limit) < AT_LIMIT * unit
            }
        )
        try:
            here, by_u, by_theta = self._derivatives(inputs, p)
        except (RangeError, np.linalg.LinAlgError):
            return np.zeros((q, q))
        weights = np.zeros(len(here))
        weights[0] = 1.0
        if active:
            weights[active] = -np.linalg.lstsq(here[active][:, free].T, here[0, free], rcond=None)[0]
        ways = null_space(here[active][:, free]) if active else np.eye(len(free))
        if not ways.size:
            return np.zeros((q, q))
        curvature = -ways.T @ np.tensordot(weights, by_u, 1)[np.ix_(free, free)] @ ways
        mixed = ways.T @ np.tensordot(weights, by_theta, 1)[free]
        values, axes = np.linalg.eigh((curvature + curvature.T) / 2)
        along = (axes.T @ mixed)[values > 0]
        return np.asarray(along.T @ (along / values[values > 0, None]))

    def _derivatives(self, u: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Slopes (1 + k, m), and their central differences by the moved inputs (.., m) and parameters (.., q)."""
        guess = steady_state(self._model, u, p).state

        def slopes(inputs: FloatArray, parameters: FloatArray) -> FloatArray:
            x = steady_state(self._model, inputs, parameters, guess=guess).state
            return self._slopes(x, inputs, parameters)[0]

        found = []
        for which, indices in ((0, self.layout.moved), (1, self._adapted)):
            columns = []
            for i in indices:
                step, ends = STEP * abs((u, p)[which][i]), []
                for side in (1.0, -1.0):
                    at = [u.copy(), p.copy()]
                    at[which][i] += side * step
                    ends.append(slopes(*at))
                columns.append((ends[0] - ends[1]) / (2 * step))
            found.append(np.stack(columns, axis=-1))
        return slopes(u, p), found[0], found[1]
