"""Turn a model's equations into CasADi functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.quantities import Kind
from adaptive_flot.greybox.scope import Scope, Site

NEWTON_STEPS = 3
"""Newton iterations that close the algebraic loop inside the explicit right-hand side. Convergence is quadratic from a
physical guess: at a thick overflow (n 20 % below nominal, much air, high level) the second leaves 2e-5 of the gas
velocity, the third 2e-10."""


Names = Mapping[Kind, Sequence[str]]


@dataclass(frozen=True)
class Built:
    """CasADi functions of a model; see `Model` for their arguments."""

    dae: ca.Function
    ode: ca.Function
    decay: ca.Function
    sites: tuple[Site, ...]
    site_values: ca.Function


def _collect(what: str, declared: Sequence[str], given: Mapping[str, ca.SX], model: str) -> ca.SX:
    missing = [n for n in declared if n not in given]
    extra = [n for n in given if n not in declared]
    if missing or extra:
        problem = f"{what} not given: {', '.join(missing)}" if missing else f"{what} not declared: {', '.join(extra)}"
        raise ModelError(f"model '{model}': {problem}; declare and give each of them once")
    return ca.vertcat(*(given[n] for n in declared)) if declared else ca.SX(0, 1)


def build(model: str, names: Names, equations: Callable[[Scope], None], effects: Sequence[Effect] = ()) -> Built:
    """Write the equations of the model named `model` into a scope and make its functions; `names` by kind.

    Raises
    ------
    ModelError
        A derivative, output, signal or residual is missing, given twice or not declared.
    """
    kinds: tuple[Kind, ...] = ("states", "inputs", "parameters", "algebraic")
    symbols: dict[Kind, dict[str, ca.SX]] = {k: {n: ca.SX.sym(n) for n in names[k]} for k in kinds}
    t = ca.SX.sym("t")
    scope = Scope(symbols, t, effects)
    equations(scope)
    for effect in effects:
        if effect.site not in scope.sites:
            raise ModelError(f"model '{model}' has no site {effect.site!r}; {near_match(effect.site, scope.sites)}")

    x, u, p, z = (ca.vertcat(*symbols[k].values()) if symbols[k] else ca.SX(0, 1) for k in kinds)
    rates = _collect("derivatives", names["states"], scope.derivatives, model)
    outputs = _collect("outputs", names["outputs"], scope.outputs, model)
    signals = _collect("signals", names["signals"], scope.signals, model)
    residuals = {n: r for n, (r, _) in scope.residuals.items()}
    residual = _collect("residuals", names["algebraic"], residuals, model)

    options = {"cse": True}
    dae = ca.Function(
        "dae",
        [t, x, u, p, z],
        [rates, residual, outputs, signals],
        ["t", "x", "u", "p", "z"],
        ["xdot", "residual", "y", "s"],
        options,
    )
    value = ca.vertcat(*(scope.residuals[n][1] for n in names["algebraic"]))
    if names["algebraic"]:
        newton = ca.Function("newton", [t, x, u, p, z], [residual, ca.jacobian(residual, z)], options)
        for _ in range(NEWTON_STEPS):
            f, slope = newton(t, x, u, p, value)
            value = value - (f / slope if len(names["algebraic"]) == 1 else ca.solve(slope, f))
    else:
        value = ca.SX(0, 1)
    xdot, _, y, s = dae(t, x, u, p, value)
    ode = ca.Function("ode", [t, x, u, p], [xdot, y, s, value], ["t", "x", "u", "p"], ["xdot", "y", "s", "z"], options)
    rates_of_decay = ca.vertcat(*(scope.decays.get(n, ca.SX(0)) for n in names["states"]))
    decay = ca.Function("decay", [t, x, u, p, z], [ca.densify(rates_of_decay)], options)
    values = ca.vertcat(*scope.site_values.values()) if scope.site_values else ca.SX(0, 1)
    site_values = ca.Function("site_values", [t, x, u, p, z], [ca.densify(values)], options)
    return Built(dae, ode, decay, tuple(scope.sites.values()), site_values)


def tangent(built: Built, seeds: ca.DM) -> ca.Function:
    """The right-hand side and its derivatives along several directions: Jacobians, worked out once, times each.

    The directions of the parameters, `seeds` (np, q), are constants: as symbols they would triple the work of building.
    The algebraic variable is solved for inside, as in `ode`: the solution and the derivatives have much in common.
    """
    t, x, u, p, z = built.dae.sx_in()
    dx = ca.SX.sym("dx", x.numel(), seeds.shape[1])
    rates, residual, y, _ = built.dae(t, x, u, p, z)
    decays = built.decay(t, x, u, p, z)
    both = ca.vertcat(rates, y, decays)

    def along(value: ca.SX) -> ca.SX:
        return ca.mtimes(ca.jacobian(value, x), dx) + ca.mtimes(ca.jacobian(value, p), seeds)

    change = along(both)
    if z.numel():
        slope, moved = ca.jacobian(residual, z), along(residual)
        dz = -moved / slope if z.numel() == 1 else -ca.solve(slope, moved)
        change += ca.mtimes(ca.jacobian(both, z), dz)
    change = ca.densify(change)
    nx = x.numel()
    results = [rates, y, decays, change[:nx, :], change[nx:-nx, :], change[-nx:, :]]
    at_z = ca.Function("tangent_at", [t, x, u, p, z, dx], results)
    return ca.Function(
        "tangent",
        [t, x, u, p, dx],
        list(at_z(t, x, u, p, built.ode(t, x, u, p)[3], dx)),
        ["t", "x", "u", "p", "dx"],
        ["xdot", "y", "decay", "dxdot", "dy", "ddecay"],
        {"cse": True},
    )
