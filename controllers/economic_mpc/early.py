"""A plan before its time, where a limited output has left what was planned and lies beyond its limit.

A step of a disturbance that nobody announced is else answered at the next move, up to `move_s` later. The largest move
holds over any `move_s`: an early move and the one before it together may not exceed it. Two plans in a row are not
early, so a noisy output makes at most twice as many plans. Nor is one that follows a plan made beyond the limit.
"""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.problem.layout import StageLayout
from controllers.economic_mpc.scenarios import Misfit
from controllers.economic_mpc.state import MpcState


class Early:
    """Says when a plan is due before its time.

    Parameters
    ----------
    layout
        Of the problem.
    limits
        Values of the output limits, with the distance that is kept from them.
    """

    def __init__(self, layout: StageLayout, limits: FloatArray) -> None:
        self._ends = [(layout.outputs.index(end.output), end.is_upper) for end in layout.output_limits]
        self._limits = limits
        self._kept = np.abs(limits - [end.value for end in layout.output_limits])

    def may_follow(self, came: FloatArray) -> bool:
        """Whether outputs (k,) keep their limits at the time of a plan: on the way back to a limit nothing is new."""
        ends = zip(self._ends, self._limits, self._kept, strict=True)
        return all(came[i] <= limit + kept if up else came[i] >= limit - kept for (i, up), limit, kept in ends)

    def is_due(self, state: MpcState, came: FloatArray) -> bool:
        """Whether an output (k,) is beyond a limit, and by more than the kept distance from what was planned."""
        if state.moved_from is None or state.misfit.expected is None:
            return False
        planned = state.misfit.expected[1]
        for (i, is_upper), limit, kept in zip(self._ends, self._limits, self._kept, strict=True):
            side = 1.0 if is_upper else -1.0
            if side * (came[i] - limit) > 0 and side * (came[i] - planned[i]) > kept:
                return True
        return False


def narrowed(
    bounds: dict[str, FloatArray], layout: StageLayout, held: FloatArray, before: FloatArray
) -> dict[str, FloatArray]:
    """Bounds in which the first move and the one before it are no larger together than one may be.

    Parameters
    ----------
    bounds
        Of a plan.
    layout
        Of the problem.
    held, before
        Moved inputs now and before the last move (m,).
    """
    row, made = layout.rows["moves"][0], (held - before) / layout.u_scale
    lbg, ubg = bounds["lbg"].copy(), bounds["ubg"].copy()
    lbg[row] = np.maximum(lbg[row], np.minimum(lbg[row] - made, 0.0))
    ubg[row] = np.minimum(ubg[row], np.maximum(ubg[row] - made, 0.0))
    return bounds | {"lbg": lbg, "ubg": ubg}


def counted(misfit: Misfit, time: float, came: FloatArray) -> Misfit:
    """The error of a plan that is given up before the end of its first move."""
    assert misfit.expected is not None
    return Misfit((time, misfit.expected[1]), misfit.variance, misfit.count).after(time, came, 1.0)
