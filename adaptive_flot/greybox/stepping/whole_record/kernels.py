"""What one step of a model needs, as lists of scalar operations: slopes, decay rates, outputs, their Jacobians.

The Jacobians are total ones: the algebraic variable moves along, by the implicit function rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.fast_step import Phis, far_phi, series_phi, weights


@dataclass(frozen=True)
class Kernels:
    """SX functions of one step.

    Attributes
    ----------
    rates
        `(x, t, u, p) -> (xdot, decay)` and, where there are unknowns, the entries that are not zero of their Jacobian
        by (x, unknown parameters).
    ends
        `(x, t, u, p) -> (y, s)` and the same entries of the Jacobian of y.
    near, far
        `(z, h, z) ->` the six weights of the method for one state, and their derivatives by z: for z > -1, and for
        others. With z twice their operations are those of the plain step, to the last bit.
    rates_entries, ends_entries
        Row and column of each entry of the Jacobians, by rows.
    decays
        For each state 0 where it has no decay rate, 1 where that is near zero in every step, 2 where it may be far.
    """

    rates: ca.Function
    ends: ca.Function
    near: ca.Function
    far: ca.Function
    rates_entries: tuple[tuple[int, int], ...]
    ends_entries: tuple[tuple[int, int], ...]
    decays: tuple[int, ...]


def kernels(model: Model, wrt: tuple[str, ...] | None, fixed_step: bool) -> Kernels:
    """The functions of a model.

    Parameters
    ----------
    model
        The model.
    wrt
        Unknown parameters, none of them where only the initial state is unknown; None without any derivatives.
    fixed_step
        Whether the step has one length for the whole record: the weights are then those of `Stepper`'s series.
    """
    t, x, u, p = model.ode.sx_in()
    z = ca.SX.sym("z", len(model.algebraic))
    rates, residual, y, s = model.dae(t, x, u, p, z)
    decay = ca.densify(model.decay(t, x, u, p, z))
    solved = model.ode(t, x, u, p)[3]

    def at_solution(values: list[ca.SX]) -> list[ca.SX]:
        found = ca.Function("at", [t, x, u, p, z], values)(t, x, u, p, solved)
        return list(found) if len(values) > 1 else [found]

    def total(values: ca.SX) -> ca.SX:
        unknown = ca.vertcat(x, *(p[i] for i in model.indices("parameters", wrt or ())))
        slope = ca.jacobian(values, unknown)
        if z.numel():
            moved, by_z = ca.jacobian(residual, unknown), ca.jacobian(residual, z)
            dz = -moved / by_z if z.numel() == 1 else -ca.solve(by_z, moved)
            slope += ca.mtimes(ca.jacobian(values, z), dz)
        return slope

    def kernel(name: str, values: list[ca.SX], moving: ca.SX) -> tuple[ca.Function, tuple[tuple[int, int], ...]]:
        slope = ca.SX(moving.numel(), 0) if wrt is None else ca.sparsify(total(moving))
        # by rows: those of the slopes come before those of the decay rates
        entries = tuple(sorted(zip(*slope.sparsity().get_triplet(), strict=True)))
        results = at_solution(
            [*map(ca.densify, values), ca.vertcat(ca.SX(0, 1), *(slope[row, column] for row, column in entries))]
        )
        return ca.Function(name, [x, t, u, p], results, {"cse": True}), entries

    rates_kernel, rates_entries = kernel("rates", [rates, decay], ca.vertcat(rates, decay))
    ends_kernel, ends_entries = kernel("ends", [y, s], y)
    near, far = weight_kernels(fixed_step, wrt is not None)
    return Kernels(
        rates_kernel,
        ends_kernel,
        near,
        far,
        rates_entries,
        ends_entries,
        tuple(
            0 if decay[i].is_zero() else 1 if fixed_step and not jumps else 2 for i, jumps in enumerate(model.jumping)
        ),
    )


@lru_cache(maxsize=4)
def weight_kernels(fixed_step: bool, derivatives: bool) -> tuple[ca.Function, ca.Function]:
    """The functions `near` and `far` of `Kernels`, which are the same for every model."""
    z, again, h = (ca.SX.sym(name) for name in ("z", "again", "h"))

    def kernel(name: str, phi: Callable[[ca.SX], Phis]) -> ca.Function:
        values = weights(z, h, phi(z if fixed_step and name == "near" else again))
        both = ca.vertcat(z, again)
        slopes = [ca.jtimes(w, both, ca.SX.ones(2)) for w in values] if derivatives else []
        return ca.Function(name, [z, h, again], [ca.vertcat(*values, *slopes)], {"cse": True})

    return kernel("near", series_phi), kernel("far", far_phi)
