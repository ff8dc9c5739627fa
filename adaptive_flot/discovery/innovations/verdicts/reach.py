"""Outputs that effects can change at all."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.greybox.model import Model


def outputs_in_reach(before: Model, after: Model) -> tuple[str, ...]:
    """Names of the outputs that the effects of one model can change which another one lacks.

    Those of a sensor change what it shows, and nothing else. Those of what a state depends on change that state, each
    state that depends on it, and the outputs that show one of these.

    Parameters
    ----------
    before, after
        The model without the effects, and with them; what they bring follows the states and parameters of the first.
    """
    names = after.names("outputs")
    nx, n_p = len(before.states), len(before.parameters)

    def by(result: int, argument: int) -> BoolArray:
        found: BoolArray = np.array(ca.DM(after.ode.jac_sparsity(result, argument), 1)) != 0
        return found

    def touched(result: int) -> BoolArray:
        brought = np.hstack([by(result, 1)[:, nx:], by(result, 3)[:, n_p:]])
        return np.asarray(brought.any(axis=1), dtype=bool)

    # the algebraic variable is solved for inside, so that what goes by it is seen as well
    states, on_states = touched(0), by(0, 1)
    for _ in range(len(states)):
        states |= on_states[:, states].any(axis=1)
    states[nx:] = False  # what an effect brings with it is no state of the process
    shown = touched(1) | by(1, 1)[:, states].any(axis=1)
    return tuple(n for n, reached in zip(names, shown, strict=True) if reached)
