"""Steady states of many members at once, each with its own inputs and parameters."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.function_cache import FunctionCache
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import CONVERGED, solve_for_slope

MOST_STEPS = 50
SETTLED = 1e-14
"""Newton's method has ended where it moves every state by less than this share of its scale."""


class SteadyStates:
    """Newton's method in scaled states for all members of a model; a member's result does not depend on the others.

    It agrees with `steady_state` to rounding. It has nothing to fall back on: a member that it does not bring to an end
    is told apart, and `steady_state` may find it.

    Parameters
    ----------
    model
        The model.
    wrt
        Parameters for which `gradient` differentiates.
    """

    def __init__(self, model: Model, wrt: Sequence[str] = ()) -> None:
        self.model, self._wrt = model, tuple(wrt)
        self._scale = np.array([q.scale for q in model.states])
        self._lower = np.array([q.lower for q in model.states])
        self._upper = np.array([q.upper for q in model.states])
        self._lanes: FunctionCache[Lanes] = FunctionCache(1)

    def find(
        self, inputs: FloatArray, parameters: FloatArray, guess: FloatArray | None = None, time: float = 0.0
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """States (M, nx), and for which members these are steady states within the physical range of every state.

        Parameters
        ----------
        inputs, parameters
            Held inputs (M, nu) and parameters (M, np).
        guess
            First guesses (M, nx), or (nx,) for all; default that of the model.
        time
            Time [s] at which a model that depends on time is taken.
        """
        start = self.model.first_guess if guess is None else guess
        scaled = np.broadcast_to(start, (len(inputs), len(self._scale))) / self._scale
        moving = np.ones(len(inputs), dtype=bool)
        for _ in range(MOST_STEPS):
            rate, slope, _ = self._evaluate(scaled * self._scale, inputs, parameters, time)
            moved = _newton(rate / self._scale, slope * self._scale[None, :] / self._scale[:, None])
            moving &= np.isfinite(moved).all(axis=1)
            scaled = np.where(moving[:, None], scaled - np.where(moving[:, None], moved, 0.0), scaled)
            moving &= np.abs(moved).max(axis=1) > SETTLED * np.maximum(1.0, np.abs(scaled).max(axis=1))
            if not moving.any():
                break
        found = scaled * self._scale
        rate, _, _ = self._evaluate(found, inputs, parameters, time)
        settled = np.abs(rate / self._scale).max(axis=1) < CONVERGED
        return found, settled & (found >= self._lower).all(axis=1) & (found <= self._upper).all(axis=1)

    def gradient(self, states: FloatArray, inputs: FloatArray, parameters: FloatArray, time: float = 0.0) -> FloatArray:
        """d(steady state)/d(parameters) (M, nx, q) at steady states; see `steady_state_gradient`."""
        _, slope, by_parameters = self._evaluate(states, inputs, parameters, time)
        scaled, right = slope * self._scale[None, :] / self._scale[:, None], by_parameters / self._scale[:, None]
        moved = np.array([solve_for_slope(a, b) for a, b in zip(scaled, right, strict=True)])
        gradient: FloatArray = -moved * self._scale[:, None]
        return gradient

    def _evaluate(
        self, states: FloatArray, inputs: FloatArray, parameters: FloatArray, time: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        lanes = self._lanes.get("rate", self._made)
        fixed = {"t": np.array([float(time)]), "x": states, "u": inputs, "p": parameters}
        found = lanes(len(states), 1, fixed, {}, last=["rate", "slope", "by_p"])
        return found["rate"], found["slope"], found["by_p"]

    def _made(self) -> Lanes:
        function = self.model.derived(_rate_and_slopes, self._wrt)
        return Lanes(function, {}, ("slope", "by_p"), as_machine_code=self.model.compiled)


def _newton(rate: FloatArray, slope: FloatArray) -> FloatArray:
    """The step (M, nx); NaN for a member whose slope is singular or not finite."""
    moved = np.full_like(rate, np.nan)
    usable = np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(rate).all(axis=1)
    try:
        moved[usable] = np.linalg.solve(slope[usable], rate[usable, :, None])[..., 0]
    except np.linalg.LinAlgError:
        for m in np.flatnonzero(usable):
            try:
                moved[m] = np.linalg.solve(slope[m], rate[m])
            except np.linalg.LinAlgError:
                continue
    return moved


def _rate_and_slopes(model: Model, wrt: tuple[str, ...]) -> ca.Function:
    """`(t, x, u, p) -> (dx/dt, its derivatives for x and for some parameters)`."""
    t, x, u, p = model.ode.sx_in()
    rate = model.ode(t, x, u, p)[0]
    slope = ca.densify(ca.jacobian(rate, x))
    by_p = ca.densify(ca.jacobian(rate, p)[:, model.indices("parameters", wrt)])
    names = ["t", "x", "u", "p"], ["rate", "slope", "by_p"]
    return ca.Function("rate_and_slopes", [t, x, u, p], [ca.densify(rate), slope, by_p], *names)
