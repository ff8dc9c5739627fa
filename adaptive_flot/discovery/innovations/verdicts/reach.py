"""Outputs that effects can change at all."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import Model


def outputs_in_reach(before: Model, after: Model) -> tuple[str, ...]:
    """Names of the outputs that the effects of one model can change which another one lacks.

    Those of a sensor change what it shows, and nothing else. Those of anything that a state depends on may change all.

    Parameters
    ----------
    before, after
        The model without the effects, and with them; what they bring follows the states and parameters of the first.
    """
    names = after.names("outputs")
    nx, n_p = len(before.states), len(before.parameters)

    def depends(result: int) -> np.ndarray:
        on_states, on_parameters = (np.array(ca.DM(after.ode.jac_sparsity(result, k), 1)) != 0 for k in (1, 3))
        reached: np.ndarray = on_states[:, nx:].any(axis=1) | on_parameters[:, n_p:].any(axis=1)
        return reached

    if depends(0)[:nx].any() or depends(3).any():
        return names
    return tuple(n for n, reached in zip(names, depends(1), strict=True) if reached)
