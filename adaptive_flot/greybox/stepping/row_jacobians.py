"""Jacobians of the step in every row of a run."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from adaptive_flot.greybox.quantities import FloatArray
from adaptive_flot.greybox.stepping.rows import over_rows
from adaptive_flot.greybox.stepping.stepper import Stepper

ROWS_AT_ONCE = 500

Jacobians = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def row_jacobians(
    stepper: Stepper, states: FloatArray, time: FloatArray, inputs: FloatArray, p: FloatArray, wrt: Sequence[str]
) -> Jacobians:
    """Derivatives of state and outputs at the end of each interval, by the state at its start and by q parameters.

    Parameters
    ----------
    stepper
        The step.
    states, time
        State (n, nx) and time (n,) [s] at the start of each interval of a run.
    inputs, p
        Inputs held in each interval (n, nu), as the stepper takes them, and parameters (np,).
    wrt
        The q parameters; one may be there more than once.

    Returns
    -------
    tuple
        dx_dx (n, nx, nx), dx_dtheta (n, nx, q), dy_dx (n, ny, nx), dy_dtheta (n, ny, q).
    """
    each = tuple(dict.fromkeys(wrt))
    if len(each) < len(wrt):
        columns = [each.index(name) for name in wrt]
        A, G, C, H = row_jacobians(stepper, states, time, inputs, p, each)
        return A, G[:, :, columns], C, H[:, :, columns]
    n, nx, q, ny = len(inputs), states.shape[1], len(wrt), len(stepper.model.outputs)
    code = stepper.record_code(n, tuple(wrt))
    if code is not None:
        anew = np.hstack([np.zeros((nx, q)), np.eye(nx)])
        rows = code(states[0], inputs, p, float(time[0]), anew, anew=True)
        x, y = rows.state_gradients, rows.gradients
        return x[:, :, q:], x[:, :, :q], y[:, :, q:], y[:, :, :q]
    A, G, C, H = (np.empty((n, height, width)) for height in (nx, ny) for width in (nx, q))
    function, mapped = stepper.one_step_jacobians(wrt), dict[int, ca.Function]()
    for start in range(0, n, ROWS_AT_ONCE):
        part = slice(start, min(start + ROWS_AT_ONCE, n))
        count = part.stop - part.start
        call = mapped.setdefault(count, over_rows(function, count))
        blocks = call(states[part].T, time[part], inputs[part].T, p)[2:]
        for target, value in zip((A, G, C, H), blocks, strict=True):
            height, width = target.shape[1:]
            target[part] = np.array(value).reshape(height, count, width).transpose(1, 0, 2)
    return A, G, C, H
