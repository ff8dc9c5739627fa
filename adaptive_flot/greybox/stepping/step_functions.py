"""The compiled functions of one sampling interval: the step, its derivatives, and many of them in a row.

Each builder takes a model and hashable arguments, as `Model.derived` asks for.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.compiling.compiled import compiled
from adaptive_flot.greybox.stepping.fast_step import Moving, Symbols, fast_step, fast_step_along

IDAS_TOLERANCE = 1e-11
MOST_SIMPLIFIED = 20
"""Steps in one function up to which common terms are looked for; with more it takes ten times as long as the rest, and
saves a twentieth of the operations. The numbers are the same."""
MOST_AT_ONCE = 120
"""Most steps in one function, the form that an estimator needs: it takes up to a minute to make."""


@dataclass(frozen=True)
class Interval:
    """How one sampling interval is integrated.

    Attributes
    ----------
    dt
        Its length [s]; None where the length is a further input, the last of u.
    substeps
        Steps of the fast method in it.
    accurate
        Integrate the DAE with IDAS at a relative tolerance of 1e-11 instead.
    """

    dt: float | None
    substeps: int
    accurate: bool = False

    @property
    def options(self) -> dict[str, bool]:
        """How CasADi makes a function of the interval."""
        return {"cse": self.substeps <= MOST_SIMPLIFIED}


def check_interval(model: Model, dt: float, substeps: int | None = None) -> None:
    """Refuse a sampling interval that no estimator can step over at once; a record of it may still be simulated.

    Parameters
    ----------
    model
        The model, whose `max_step_s` is the longest step.
    dt
        Sampling interval [s].
    substeps
        Steps of the fast method in it; default as many as the model asks for.

    Raises
    ------
    ModelError
        It takes more than MOST_AT_ONCE steps.
    """
    count = substeps or model.steps_in(dt)
    if count > MOST_AT_ONCE:
        raise ModelError(
            f"a sampling interval of {dt:g} s takes {count:g} steps of model {model.name!r}, whose longest is "
            f"{model.max_step_s:g} s; at most {MOST_AT_ONCE} can be taken at once: sample more often"
        )


def step(model: Model, interval: Interval) -> ca.Function:
    """`(x, t, u, p) -> (x_next, y, s)`: t [s] at the start of the interval, y and s at its end."""
    if interval.accurate:
        return _idas_step(model, interval)
    if interval.dt is not None:
        check_interval(model, interval.dt, interval.substeps)
    return fast_step(model, interval.dt, interval.substeps, interval.options)


def one_step_gradient(model: Model, interval: Interval, wrt: tuple[str, ...]) -> ca.Function:
    """`(x, t, u, p) -> (x_next (nx,), y (ny,), dy_dtheta (ny, q))` for the q parameters `wrt`; x is held."""
    x, t, u, p = symbols = _symbols(model, interval)
    end, y = _along(model, interval, symbols, ca.SX(x.numel(), len(wrt)), _parameter_seeds(model, wrt))
    names = ["x", "t", "u", "p"], ["x_next", "y", "dy_dtheta"]
    return ca.Function("one_step_gradient", [x, t, u, p], [end.value, y.value, y.along], *names, interval.options)


def one_step_jacobians(model: Model, interval: Interval, wrt: tuple[str, ...]) -> ca.Function:
    """`(x, t, u, p) -> (x_next, y, dx_dx, dx_dtheta, dy_dx, dy_dtheta)`, exact, in forward mode."""
    x, t, u, p = symbols = _symbols(model, interval)
    nx, q = x.numel(), len(wrt)
    moved = ca.horzcat(ca.SX.eye(nx), ca.SX(nx, q))
    seeds = ca.horzcat(ca.DM(p.numel(), nx), _parameter_seeds(model, wrt))
    end, y = _along(model, interval, symbols, moved, seeds)
    blocks = [m.along[:, columns] for m in (end, y) for columns in (slice(0, nx), slice(nx, nx + q))]
    names = ["x", "t", "u", "p"], ["x_next", "y", "dx_dx", "dx_dtheta", "dy_dx", "dy_dtheta"]
    return ca.Function("one_step_jacobians", [x, t, u, p], [end.value, y.value, *blocks], *names, interval.options)


def sensitivity_step(model: Model, interval: Interval, wrt: tuple[str, ...], unknowns: int) -> ca.Function:
    """`(x, S (nx, q), t, u, p) -> (x_next, S_next (nx, q), y, dy (ny, q))`, exact for the step itself.

    The q `unknowns` are the parameters `wrt`, followed by further ones that act through the state alone.
    """
    x, t, u, p = symbols = _symbols(model, interval)
    sensitivity = ca.SX.sym("S", x.numel(), unknowns)
    seeds = ca.horzcat(_parameter_seeds(model, wrt), ca.DM(p.numel(), unknowns - len(wrt)))
    end, y = _along(model, interval, symbols, sensitivity, seeds)
    results = [end.value, ca.densify(end.along), y.value, ca.densify(y.along)]
    names = ["x", "S", "t", "u", "p"], ["x_next", "S_next", "y", "dy"]
    # a search runs the step of varying length some thousand times: looking for common terms takes longer
    options = {} if interval.dt is None else interval.options
    return ca.Function(f"sensitivity_step_{unknowns}", [x, sensitivity, t, u, p], results, *names, options)


def ready_step(model: Model, interval: Interval) -> ca.Function:
    """The step, as machine code where the model asks for it (IDAS is machine code already)."""
    function = model.derived(step, interval)
    return compiled(function) if model.compiled and not interval.accurate else function


def ready_sensitivity_step(model: Model, interval: Interval, wrt: tuple[str, ...], unknowns: int) -> ca.Function:
    """The step with sensitivities, as machine code where the model asks for it."""
    function = model.derived(sensitivity_step, interval, wrt, unknowns)
    return compiled(function) if model.compiled else function


def steps(model: Model, interval: Interval, rows: int) -> ca.Function:
    """The step for `rows` intervals in a row; arguments and results of the intervals side by side."""
    function = model.derived(ready_step, interval)
    return function.mapaccum(f"{function.name()}_x{rows}", rows, 1)


def sensitivity_steps(model: Model, interval: Interval, wrt: tuple[str, ...], unknowns: int, rows: int) -> ca.Function:
    """The step with sensitivities for `rows` intervals in a row, side by side."""
    function = model.derived(ready_sensitivity_step, interval, wrt, unknowns)
    # mapaccum carries only the first argument unless told how many: with a state and its sensitivity it must be 2,
    # else the sensitivity silently forgets the past
    return function.mapaccum(f"{function.name()}_x{rows}", rows, 2)


def _symbols(model: Model, interval: Interval) -> Symbols:
    if interval.accurate:
        raise ModelError("exact sensitivities are those of the fast step; build the stepper with accurate=False")
    if interval.dt is not None:
        check_interval(model, interval.dt, interval.substeps)
    t, x, u, p = model.ode.sx_in()
    return x, t, u if interval.dt is not None else ca.vertcat(u, ca.SX.sym("dt")), p


def _along(model: Model, interval: Interval, symbols: Symbols, moved: ca.SX, seeds: ca.DM) -> tuple[Moving, Moving]:
    x, t, u, p = symbols
    if interval.dt is None:
        return fast_step_along(model, u[-1], interval.substeps, (x, t, u[:-1], p), moved, seeds)
    return fast_step_along(model, interval.dt, interval.substeps, (x, t, u, p), moved, seeds)


def _parameter_seeds(model: Model, wrt: tuple[str, ...]) -> ca.DM:
    return ca.DM.eye(len(model.parameters))[:, model.indices("parameters", wrt)]


def _idas_step(model: Model, interval: Interval) -> ca.Function:
    assert interval.dt is not None  # a step of varying length is always a fast one
    dt = interval.dt
    # IDAS integrates in scaled time over [0, 1] and in scaled states, so that one tolerance fits quantities of
    # 1e-4 m3/s and of 40 kg alike; the physical time enters the equations as a parameter plus the scaled time.
    nx, nu, npar, nz = (len(q) for q in (model.states, model.inputs, model.parameters, model.algebraic))
    scale = ca.DM([q.scale for q in model.states])
    xi, z, tau = ca.SX.sym("xi", nx), ca.SX.sym("z", nz), ca.SX.sym("tau")
    held = ca.SX.sym("held", 1 + nu + npar)
    t, u, p = held[0], held[1 : 1 + nu], held[1 + nu :]
    xdot, residual, _, _ = model.dae(t + dt * tau, xi * scale, u, p, z)
    problem = {"x": xi, "z": z, "p": held, "t": tau, "ode": dt * xdot / scale, "alg": residual}
    options = {"reltol": IDAS_TOLERANCE, "abstol": IDAS_TOLERANCE * 1e-2, "max_num_steps": 100_000}
    integrator = ca.integrator("idas", "idas", problem, 0.0, 1.0, options)

    X, T, U, P = ca.MX.sym("x", nx), ca.MX.sym("t"), ca.MX.sym("u", nu), ca.MX.sym("p", npar)
    guess = model.ode(T, X, U, P)[3]
    solution = integrator(x0=X / scale, z0=guess, p=ca.vertcat(T, U, P))
    end = solution["xf"] * scale
    _, _, y, s = model.dae(T + dt, end, U, P, solution["zf"])
    names = ["x", "t", "u", "p"], ["x_next", "y", "s"]
    return ca.Function("accurate_step", [X, T, U, P], [end, y, s], *names)
