"""Correct a predicted state by measured outputs, with the gain of a steady-state Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from adaptive_flot.contracts import Setup
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper

REACH = 10.0
"""Errors beyond so many standard deviations move the state no further."""


@dataclass(frozen=True)
class Correction:
    """Gain (nx, c) from errors of the outputs to the state, and the largest error that counts in full (c,)."""

    gain: FloatArray
    reach: FloatArray


class StateCorrection:
    """Designs the gain for an operating point, from the model's own derivatives.

    With disturbances w of the state at the start of an interval, A and C the derivatives of the next state and of the
    outputs for the state at its start, Q and R the covariances of disturbance and measurement::

        X = A (X - X C' (C X C' + R)^-1 C X) A' + Q          K = A X C' (C X C' + R)^-1

    Source: Anderson & Moore, *Optimal Filtering* (1979), chapter 4.

    Parameters
    ----------
    setup
        Model and sampling interval.
    noise
        The c outputs that correct the state: standard deviation of the noise of each by name, in the output's unit.
    state_noise
        Standard deviation that disturbances add to each state within a second, as a share of its scale.

    Raises
    ------
    ModelError
        An output that the model does not have, a noise or a state_noise that is not positive.
    """

    def __init__(self, setup: Setup, noise: Mapping[str, float], state_noise: float) -> None:
        wrong = [name for name, std in noise.items() if not std > 0]
        if wrong:
            raise ModelError(f"correct_state: noise of {wrong[0]!r} = {noise[wrong[0]]:g}; give a positive one")
        if not state_noise > 0:
            raise ModelError(f"state_noise = {state_noise:g}; give a positive share, for example 1e-3")
        self.outputs = tuple(noise)
        self.rows = setup.model.indices("outputs", self.outputs)
        self._setup = setup
        self._noise = np.array(list(noise.values()))
        self._disturbance = state_noise * np.sqrt(setup.dt) * np.array([state.scale for state in setup.model.states])
        if noise:
            jacobians = Stepper(setup.model, setup.dt).one_step_jacobians(setup.parameters)
            self._jacobians = FastCall(jacobians, matrices=("dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"))

    def design(self, x: FloatArray, time: float, inputs: FloatArray, p: FloatArray, theta: FloatArray) -> Correction:
        """Gain at a state, inputs and parameters.

        Zero where the design fails (a state or derivative that is not finite): the state is then predicted only.
        """
        now = p.copy()
        now[self._setup.model.indices("parameters", self._setup.parameters)] = theta
        _, _, A, _, dy_dx, _ = self._jacobians(x, time, inputs, now)
        # in units of disturbances and noise: levels, flows and masses differ by many orders of magnitude
        d, r = self._disturbance, self._noise
        A, C, unit = A * d / d[:, None], dy_dx[self.rows] * d / r[:, None], np.eye(len(r))
        try:
            X = solve_discrete_are(A.T, C.T, np.eye(x.size), unit)
        except (LinAlgError, ValueError):
            return Correction(np.zeros((x.size, r.size)), r)
        spread = C @ X @ C.T + unit
        K: FloatArray = A @ X @ C.T @ np.linalg.inv(spread)
        return Correction(K * d[:, None] / r, REACH * r * np.sqrt(np.diag(spread)))
