"""A plan of the optimal control problem of one model as a plan of the same problem for a model with more states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.layout import DEGREE, MOVED, SLACKS, Layout


def widened(solution: FloatArray, before: Layout, after: Layout, state: FloatArray) -> FloatArray:
    """Variables of `after` (n,) from those of `before`: the same inputs and states, the further states as in `state`.

    Parameters
    ----------
    solution
        Scaled variables of `before`.
    before, after
        Of the problems; the states of `after` are those of `before` and then further ones.
    state
        State of the model of `after` (nx,), whose further states stay as they are over the horizon.
    """
    nx, nu, nz = len(before.x_scale), len(MOVED), len(after.z_scale)
    more = (state / after.x_scale)[nx:]

    def wider(variables: FloatArray, sizes: Sequence[int]) -> FloatArray:
        parts = np.split(variables, np.cumsum(sizes)[:-1])
        holding_states = {0, *range(4, len(sizes), 2)}
        return np.concatenate([np.concatenate([p, more]) if i in holding_states else p for i, p in enumerate(parts)])

    block = before.block
    stage = [nx, nu, nu, SLACKS, *[nx, nz] * DEGREE]
    stages = [wider(solution[k * block : (k + 1) * block], stage) for k in range(before.horizon)]
    return np.concatenate([*stages, wider(solution[before.horizon * block :], [nx, nu])])
