"""The covariance of the parameters that a plan leaves: a Kalman recursion, linearised along the plan.

States x and parameters theta have the joint covariance P. A sampling interval makes it ``F P F' + Q``, with
``F = [[A, B], [0, I]]``, A = dx+/dx and B = dx+/dtheta; Q moves parameters only. A measurement with the derivatives
``h = [C, D]`` and variance r makes it ``P - P h (h' P h + r)^-1 h' P``. A plan holds states at its collocation points.
F is taken there, to the power of the intervals up to that point. So many measurements count as one of r over their
number.
Before the first move the state is what the parameters make it at rest: ``x - E x = S (theta - E theta)`` with
``S = (I - A)^-1 B``. So a plan at rest shows one combination of the parameters for each measured output.

Source: Kalman filter of an augmented state (Jazwinski, 1970, section 8.3); its covariance as the state of knowledge in
dual control: Heirung, Foss & Ydstie, Journal of Process Control 32 (2015) 64.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adaptive_flot.contracts import ControllerSetup
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from controllers.economic_mpc.problem.layout import StageLayout

HOUR = 3600.0
POINTS = 1 / 3, 1.0
"""Where the collocation points of Radau's method of degree 2 lie in a move."""


class Information:
    """Predicts covariances.

    Parameters
    ----------
    setup
        Model, sampling interval and adapted parameters (q).
    layout
        Of the plans.
    noise_std
        Standard deviation of the noise of each measured output, by name, in its unit.
    walk
        Standard deviation of what each parameter changes in an hour, as a share of it.

    Raises
    ------
    ModelError
        No measured output, one that the model lacks, or a noise that is not positive.
    """

    def __init__(
        self, setup: ControllerSetup, layout: StageLayout, noise_std: Mapping[str, float], walk: float
    ) -> None:
        if not noise_std or not all(std > 0 for std in noise_std.values()) or not walk >= 0:
            raise ModelError("probing: give noise_std > 0 of each measured output, and walk >= 0")
        self.layout, self._walk = layout, walk
        self._measured = setup.model.indices("outputs", noise_std)
        self._variance = np.array(list(noise_std.values())) ** 2
        self._dt = setup.dt
        jacobians = Stepper(setup.model, setup.dt).one_step_jacobians(setup.parameters)
        self._jacobians = FastCall(jacobians, matrices=("dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"))

    def __call__(
        self,
        plan: FloatArray,
        held: FloatArray,
        parameters: FloatArray,
        theta: FloatArray,
        covariance: FloatArray,
        now: tuple[float, FloatArray],
    ) -> FloatArray:
        """Covariances of the parameters (horizon + 1, q, q): now, and after each move of a plan.

        Parameters
        ----------
        plan
            Its variables (n,).
        held
            Inputs now (nu,); those that are not moved stay.
        parameters, theta
            All parameters (np,) and the adapted ones (q,).
        covariance
            Of the adapted parameters now (q, q).
        now
            Time [s] and state (nx,).
        """
        layout, q, (time, state) = self.layout, len(theta), now
        nx = len(state)
        _, _, A, B, _, _ = self._jacobians(state, time, held, parameters)
        root = np.vstack([np.linalg.solve(np.eye(nx) - A, B), np.eye(q)])
        joint = root @ covariance @ root.T
        drift = np.zeros(nx + q)
        drift[nx:] = (self._walk * theta) ** 2 / HOUR
        found, inputs = [covariance], held.copy()
        for k, (stage, moved) in enumerate(zip(layout.stages(plan), layout.inputs_of(plan), strict=True)):
            inputs[layout.moved] = moved
            begin = 0.0
            for j, end in enumerate(POINTS):
                x = stage[layout.point(j) : layout.point(j) + nx] * layout.x_scale
                at = time + (k + end) * layout.move_s
                joint = self._after(joint, drift, self._jacobians(x, at, inputs, parameters), (end - begin))
                begin = end
            found.append(joint[nx:, nx:])
        return np.array(found)

    def _after(
        self, joint: FloatArray, drift: FloatArray, jacobians: tuple[FloatArray, ...], share: float
    ) -> FloatArray:
        """Joint covariance after a share of a move and the measurements in it."""
        _, _, A, B, C, D = jacobians
        nx, seconds = len(A), share * self.layout.move_s
        count = max(1, round(seconds / self._dt))
        step = np.eye(len(joint))
        step[:nx, :nx], step[:nx, nx:] = A, B
        power = np.linalg.matrix_power(step, count)
        joint = power @ joint @ power.T + np.diag(drift * seconds)
        for row, variance in zip(np.hstack([C, D])[self._measured], self._variance, strict=True):
            gain = joint @ row
            joint = joint - np.outer(gain, gain) / (row @ gain + variance / count)
        return joint
