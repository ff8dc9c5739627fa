"""Linearise a model at an operating point into a python-control state space."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import control
import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall


def linearise(
    model: Model,
    inputs: FloatArray,
    parameters: FloatArray | None = None,
    state: FloatArray | None = None,
    parameters_as_inputs: Sequence[str] = (),
) -> control.StateSpace:
    """State space of small deviations, with named states, inputs and outputs, exact derivatives.

    Parameters
    ----------
    model
        The model.
    inputs
        Inputs of the operating point (nu,).
    parameters
        Parameter vector (np,); default the model's values.
    state
        State of the operating point (nx,); default the steady state of the inputs.
    parameters_as_inputs
        Names of parameters that follow as further inputs (disturbances that the model has as parameters); a dot in a
        name becomes an underscore, which python-control asks for.

    Returns
    -------
    control.StateSpace
        dx = A dx + B du, dy = C dx + D du; units are those of the model.

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """
    p = model.parameter_values if parameters is None else np.asarray(parameters, dtype=float)
    x0 = steady_state(model, inputs, p).state if state is None else state
    t, x, u, q = model.ode.sx_in()
    xdot, y, _, _ = model.ode(t, x, u, q)
    extra = [model.index("parameters", name) for name in parameters_as_inputs]
    blocks = [
        block
        for a in (xdot, y)
        for block in (ca.jacobian(a, x), ca.horzcat(ca.jacobian(a, u), ca.jacobian(a, q)[:, extra]))
    ]
    a, b, c, d = (
        m.reshape(rows, -1)
        for m, rows in zip(
            FastCall(ca.Function("linear", [t, x, u, q], blocks))(0.0, x0, inputs, p),
            (len(model.states), len(model.states), len(model.outputs), len(model.outputs)),
            strict=True,
        )
    )
    # an output and a state may share a name (level): python-control wants them apart only within a kind
    return control.ss(
        a,
        b,
        c,
        d,
        states=list(model.names("states")),
        inputs=[*model.names("inputs"), *(name.replace(".", "_") for name in parameters_as_inputs)],
        outputs=list(model.names("outputs")),
        name=model.name,
    )


def pi_gains(response: complex, lag_rad: float, crossover_rad_s: float) -> tuple[float, float]:
    """Gain and integral time [s] of a PI controller with a given phase lag and unit loop gain at the crossover.

    Parameters
    ----------
    response
        Response of what is controlled at the crossover frequency, in negative feedback.
    lag_rad
        Phase lag of the controller there, between 0 and pi/2 [rad].
    crossover_rad_s
        Crossover frequency [rad/s].
    """
    integral_time = 1 / (crossover_rad_s * np.tan(lag_rad))
    controller = 1 + 1 / (1j * crossover_rad_s * integral_time)
    return float(1 / abs(response * controller)), float(integral_time)
