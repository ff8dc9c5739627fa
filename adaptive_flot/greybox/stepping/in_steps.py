"""The steps of one interval as a loop, and what is asked at its end: a tape that is short however many steps there are.

As one function, sixteen steps with their derivatives take longer to make, and to compile, than a record takes to run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping import step_functions
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError
from adaptive_flot.greybox.stepping.recursion import RowByRow, ordered, row_by_row
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import ALONG, END, Steps, TapeRecursion


def steps_along(model: Model, dt: float, wrt: Sequence[str]) -> Steps | None:
    """The steps of an interval of `dt` [s] with derivatives by q parameters `wrt` and the nx states, in this order.

    None where the interval is one step.
    """
    times, nx, q = model.steps_in(dt), len(model.states), len(wrt)
    if times < 2:
        return None
    length = dt / times
    step = model.derived(step_functions.sensitivity_step, Interval(length, 1), tuple(wrt), q + nx)
    given = step.sx_in()
    end, along, *_ = step(*given)
    function = ca.Function("step_along", given, [ca.densify(end), ca.densify(along)], {"cse": True})
    return Steps(function, times, length, np.hstack([np.zeros((nx, q)), np.eye(nx)]))


def interval_by_interval(
    steps: Steps | None,
    after: Callable[[], ca.Function],
    whole: Callable[[], ca.Function],
    carried: Mapping[str, str],
    held: Sequence[str],
) -> RowByRow:
    """A function of an interval, over all rows: `after` its steps, or the `whole` of it as one function.

    The latter for an interval of one step (None), and without the library for tapes.
    """
    if steps is not None:
        with suppress(CompileError):
            return TapeRecursion(ordered(after(), carried), len(carried), held, steps)
    return row_by_row(whole(), carried, held)


def at_the_end(model: Model, dt: float, wrt: Sequence[str]) -> tuple[list[ca.SX], list[str], ca.SX, ca.SX]:
    """What stands at the end of the steps of an interval.

    Returns
    -------
    tuple
        The symbols END (nx,), ALONG (nx, q + nx), t at the start, u and p; their names; the outputs (ny,) at the end;
        and their derivatives (ny, q + nx), as `steps_along` has them.
    """
    t, x, u, p = model.ode.sx_in()
    q, nx = len(wrt), len(model.states)
    along = ca.SX.sym(ALONG, nx, q + nx)
    seeds = ca.horzcat(ca.DM.eye(len(model.parameters))[:, model.indices("parameters", wrt)], ca.DM(p.numel(), nx))
    _, y, _, _, slopes, _ = model.tangent(seeds)(t + dt, x, u, p, along)
    return [x, along, t, u, p], [END, ALONG, "t", "u", "p"], y, slopes


def jacobians_at_the_end(model: Model, dt: float, wrt: Sequence[str]) -> ca.Function:
    """`(x, end, along, t, u, p) -> (dx_dx, dx_dtheta, dy_dx, dy_dtheta)` of an interval; x is where it starts."""
    given, names, _, slopes = at_the_end(model, dt, wrt)
    x, along, q = ca.SX.sym("x", len(model.states)), given[1], len(wrt)
    blocks = [along[:, q:], along[:, :q], slopes[:, q:], slopes[:, :q]]
    told = ["dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"]
    return ca.Function("jacobians_at_the_end", [x, *given], blocks, ["x", *names], told, {"cse": True})
