"""Correct a predicted state by measured outputs, with the gain of a steady-state Kalman filter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.fastcall import FastCall
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepper import Stepper
from adaptive_flot.protocols import Setup


class StateCorrection:
    """Designs the gain for an operating point, from the model's own derivatives.

    With disturbances w of the state at the start of an interval, A and C the derivatives of the next state and of the
    outputs for the state at its start, Q and R the covariances of disturbance and measurement::

        X = A (X - X C' (C X C' + R)^-1 C X) A' + Q          K = A X C' (C X C' + R)^-1

    Parameters
    ----------
    setup
        Model and sampling interval.
    outputs
        Names of the c outputs that correct the state, among those of the setup.
    state_noise
        Standard deviation that disturbances add to each state within a second, as a share of its scale.

    Raises
    ------
    ModelError
        An output that is not among those of the setup, or a negative state_noise.
    """

    def __init__(self, setup: Setup, outputs: Sequence[str], state_noise: float) -> None:
        unknown = [name for name in outputs if name not in setup.outputs]
        if unknown or len(outputs) == len(setup.outputs):
            what = f"{unknown[0]!r} is" if unknown else "every output is taken, none is left to drive the parameters;"
            raise ModelError(f"correct_state: {what} not possible; the setup has {', '.join(setup.outputs)}")
        if not state_noise > 0:
            raise ModelError(f"state_noise = {state_noise:g}; give a positive share")
        self.outputs = tuple(outputs)
        self._setup = setup
        self._rows = setup.model.indices("outputs", outputs)
        self._places = [setup.outputs.index(name) for name in outputs]
        scales = np.array([state.scale for state in setup.model.states])
        self._Q = np.diag((state_noise * scales) ** 2 * setup.dt)
        if outputs:
            jacobians = Stepper(setup.model, setup.dt).one_step_jacobians(setup.parameters)
            self._jacobians = FastCall(jacobians, matrices=("dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"))

    def gain(
        self,
        x: FloatArray,
        time: float,
        inputs: FloatArray,
        p: FloatArray,
        theta: FloatArray,
        noise_std: FloatArray,
    ) -> FloatArray:
        """Gain (nx, c) at a state, inputs and parameters.

        Zero where the design fails (a state or derivative that is not finite): the state is then predicted only.
        """
        now = p.copy()
        now[self._setup.model.indices("parameters", self._setup.parameters)] = theta
        _, _, A, _, dy_dx, _ = self._jacobians(x, time, inputs, now)
        C, R = dy_dx[self._rows], np.diag(noise_std[self._places] ** 2)
        nothing = np.zeros((x.size, len(self._rows)))
        # in units of the noise: levels, flows and masses differ by many orders of magnitude
        scale = np.sqrt(np.diag(self._Q))
        A, C, unit = A * scale / scale[:, None], C * scale / np.sqrt(np.diag(R))[:, None], np.eye(len(self._rows))
        try:
            X = solve_discrete_are(A.T, C.T, np.eye(x.size), unit)
        except (LinAlgError, ValueError):
            return nothing
        K: FloatArray = A @ X @ C.T @ np.linalg.inv(C @ X @ C.T + unit)
        return K * scale[:, None] / np.sqrt(np.diag(R))
