"""Back-off from the limits of outputs for what the estimator does not know, so that they hold with a probability.

A linear output ``y = g' theta`` of parameters with covariance P has the standard deviation ``sqrt(g' P g)``. The limit
``y >= y_min`` holds with probability 1 - alpha where ``E y >= y_min + Phi^-1(1 - alpha) sqrt(g' P g)``. Source: Charnes
& Cooper, Management Science 6 (1959) 73; van Hessem & Bosgra, IEEE Conf. Decision and Control (2002), for the back-off.

g is the steady-state derivative at the present point: with the derivatives of an interval A = dx+/dx, B = dx+/dtheta,
C = dy/dx, D = dy/dtheta it is ``C (I - A)^-1 B + D``.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from adaptive_flot.contracts import ControllerSetup
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper


def quantile_of(probability: float) -> float:
    """Quantile of the standard normal distribution for a probability from 0.5 to below 1; ModelError for another."""
    if not 0.5 <= probability < 1:
        raise ModelError(f"economic_mpc: limit_probability = {probability:g}; give one from 0.5 to below 1")
    return float(norm.ppf(probability))


class SteadyGains:
    """Steady-state derivatives of outputs by the adapted parameters.

    Parameters
    ----------
    setup
        Model, sampling interval and adapted parameters (q).
    outputs
        Indices of the outputs (k,).
    """

    def __init__(self, setup: ControllerSetup, outputs: list[int]) -> None:
        self._outputs = outputs
        jacobians = Stepper(setup.model, setup.dt).one_step_jacobians(setup.parameters)
        self._jacobians = FastCall(jacobians, matrices=("dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"))

    def __call__(self, time: float, state: FloatArray, inputs: FloatArray, p: FloatArray) -> FloatArray:
        """Derivatives (k, q); 0 where there is no finite one.

        Parameters
        ----------
        time
            Time [s].
        state, inputs, p
            State (nx,), inputs (nu,) and all parameters (np,) now.
        """
        _, _, A, B, C, D = self._jacobians(state, time, inputs, p)
        try:
            g = (C @ np.linalg.solve(np.eye(len(A)) - A, B) + D)[self._outputs]
        except np.linalg.LinAlgError:
            return np.zeros((len(self._outputs), B.shape[1]))
        return np.asarray(np.where(np.isfinite(g), g, 0.0))


class ChanceConstraint:
    """Standard deviations of outputs, times the quantile that a probability asks for.

    Parameters
    ----------
    setup
        Model, sampling interval and adapted parameters (q).
    outputs
        Indices of the limited outputs, one for each limit (k,).
    probability
        With which each limit is to hold, from 0.5 (no back-off) to below 1.

    Raises
    ------
    ModelError
        The probability is outside its range.
    """

    def __init__(self, setup: ControllerSetup, outputs: list[int], probability: float) -> None:
        self.quantile = quantile_of(probability)
        self._gains = SteadyGains(setup, outputs)

    def backoff(
        self, time: float, state: FloatArray, inputs: FloatArray, p: FloatArray, covariance: FloatArray
    ) -> FloatArray:
        """Distance to keep from each limit (k,), in the unit of its output; 0 where there is no finite derivative.

        Parameters
        ----------
        time
            Time [s].
        state, inputs, p
            State (nx,), inputs (nu,) and all parameters (np,) now.
        covariance
            Of the adapted parameters (q, q).
        """
        g = self._gains(time, state, inputs, p)
        variance = np.einsum("ki,ij,kj->k", g, covariance, g)
        kept: FloatArray = np.where(np.isfinite(variance), self.quantile * np.sqrt(np.maximum(variance, 0.0)), 0.0)
        return kept
