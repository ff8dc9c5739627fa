"""Steady states of a model and their sensitivities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

import casadi as ca
import numpy as np
from scipy.optimize import root

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper

CONVERGED = 1e-9
"""Largest rate that may be left, in a state's scale a second."""
SETTLING_STEPS = 3000
"""Steps of simulation from the first guess when Newton's method does not converge from it."""


@dataclass(frozen=True)
class SteadyState:
    """A steady state of a model.

    Attributes
    ----------
    state
        The state x (nx,).
    residual
        Largest size of a scaled rate that is left, dx/dt over the scale of the state [1/s].
    """

    state: FloatArray
    residual: float


def steady_state(
    model: Model,
    inputs: FloatArray,
    parameters: FloatArray | None = None,
    guess: FloatArray | None = None,
    time: float = 0.0,
) -> SteadyState:
    """Solve dx/dt = 0 for held inputs by Newton's method in scaled states (scipy's hybrid Powell, exact Jacobian).

    Parameters
    ----------
    model
        The model; its `initial_guess` starts the search unless `guess` is given.
    inputs
        Held inputs (nu,), each in its unit.
    parameters
        Parameter vector (np,); default the model's values.
    guess
        First guess (nx,).
    time
        Time [s] at which a model that depends on time is taken; it stands still there.

    Raises
    ------
    RangeError
        No steady state was found inside the physical range of every state.
    """
    p = model.parameter_values if parameters is None else np.asarray(parameters, dtype=float)
    u = np.asarray(inputs, dtype=float)
    scale = np.array([q.scale for q in model.states])
    start = guess if guess is not None else model.first_guess
    rate = FastCall(model.ode)
    slope = _jacobian(model, "x")

    def scaled_rate(s: FloatArray) -> FloatArray:
        scaled: FloatArray = rate(time, s * scale, u, p)[0] / scale
        return scaled

    def scaled_slope(s: FloatArray) -> FloatArray:
        scaled: FloatArray = slope(time, s * scale, u, p)[0] * scale[None, :] / scale[:, None]
        return scaled

    def solve(start: FloatArray) -> tuple[FloatArray, float]:
        solution = root(scaled_rate, start / scale, jac=scaled_slope, tol=1e-13)
        return cast(FloatArray, solution.x * scale), float(np.max(np.abs(solution.fun)))

    state, residual = solve(start)
    if not residual < CONVERGED:  # let the process itself come near to where it settles, then try again
        settled = Stepper(model, model.max_step_s).simulate(start, np.tile(u, (SETTLING_STEPS, 1)), p, time).states[-1]
        if np.isfinite(settled).all():
            state, residual = solve(settled)
    lower = np.array([q.lower for q in model.states])
    upper = np.array([q.upper for q in model.states])
    if not (residual < CONVERGED and np.all(state >= lower) and np.all(state <= upper)):
        where = ", ".join(f"{q.name} = {v:g} {q.unit}" for q, v in zip(model.inputs, u, strict=True))
        raise RangeError(
            f"model '{model.name}' has no steady state within its physical range at {where} "
            f"(largest rate left {residual:.1e} of a state's scale a second); check the inputs and parameters"
        )
    return SteadyState(state, residual)


def steady_state_gradient(
    model: Model,
    state: FloatArray,
    inputs: FloatArray,
    parameters: FloatArray,
    wrt: Sequence[str],
    time: float = 0.0,
) -> FloatArray:
    """d(steady state)/d(parameters) (nx, q) by the implicit function theorem, at a steady state."""
    by_state = _jacobian(model, "x")(time, state, inputs, parameters)[0]
    by_parameters = _jacobian(model, "p")(time, state, inputs, parameters)[0]
    columns = model.indices("parameters", wrt)
    scale = np.array([q.scale for q in model.states])
    scaled = by_state * scale[None, :] / scale[:, None]
    moved = solve_for_slope(scaled, by_parameters[:, columns] / scale[:, None])
    return cast(FloatArray, -moved * scale[:, None])


def solve_for_slope(slope: FloatArray, by_parameters: FloatArray) -> FloatArray:
    """Solve slope @ moved = by_parameters; where a valve within its band leaves a state free, that state stays.

    Should the others then have no solution (a stuck valve within a control loop), the smallest move is taken.
    """
    free = np.flatnonzero(~slope.any(axis=1))
    held = slope.copy()
    held[free, free] = 1.0
    try:
        return cast(FloatArray, np.linalg.solve(held, by_parameters))
    except np.linalg.LinAlgError:
        return cast(FloatArray, np.linalg.lstsq(slope, by_parameters)[0])


def _jacobian(model: Model, wrt: Literal["x", "p"]) -> FastCall:
    """d(dx/dt)/d(x or p) as a function of (t, x, u, p)."""
    return FastCall(model.derived(_jacobian_function, wrt), matrices=("jacobian",))


def _jacobian_function(model: Model, wrt: Literal["x", "p"]) -> ca.Function:
    t, x, u, p = model.ode.sx_in()
    slope = ca.densify(ca.jacobian(model.ode(t, x, u, p)[0], {"x": x, "p": p}[wrt]))
    return ca.Function("jacobian", [t, x, u, p], [slope], ["t", "x", "u", "p"], ["jacobian"])
