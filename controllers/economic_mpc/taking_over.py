"""Going on with the inputs and the plan of a controller for a smaller model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import Estimate
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.output_bias import OutputBias
from controllers.economic_mpc.problem.layout import DEGREE, StageLayout
from controllers.economic_mpc.state import MpcState


def taken_over(
    state: MpcState,
    before: StageLayout,
    after: StageLayout,
    biases: Sequence[OutputBias],
    known: Sequence[Estimate],
    again: Sequence[Estimate],
) -> MpcState:
    """State of a controller that goes on; see `TakesOver.take_over`.

    Parameters
    ----------
    state
        Of the controller before.
    before, after
        Layouts of both.
    biases
        Filters of the limited outputs.
    known, again
        Estimates of the same samples by the model before and by the new one.
    """
    bias = tuple(b + own.change(known, again) for b, own in zip(state.bias, biases, strict=True))
    state = replace(state, bias=bias, tree=None)
    if state.plan is None or len(after.model.states) == len(before.model.states):
        return state
    return replace(state, plan=with_further_states(state.plan, before, after, again[-1].state), multipliers=None)


def with_further_states(solution: FloatArray, before: StageLayout, after: StageLayout, state: FloatArray) -> FloatArray:
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
    nx, nu, nz = len(before.x_scale), before.inputs_size, len(after.z_scale)
    further = (state / after.x_scale)[nx:]

    def extended(variables: FloatArray, sizes: Sequence[int]) -> FloatArray:
        parts = np.split(variables, np.cumsum(sizes)[:-1])
        holding_states = {0, *range(4, len(sizes), 2)}
        return np.concatenate([np.concatenate([p, further]) if i in holding_states else p for i, p in enumerate(parts)])

    block = before.block
    nu_before = nu + before.answered_size
    stage = [nx, nu_before, nu, before.slacks_size, *[nx, nz] * DEGREE]
    stages = [extended(solution[k * block : (k + 1) * block], stage) for k in range(before.horizon)]
    return np.concatenate([*stages, extended(solution[before.horizon * block :], [nx, nu_before])])
