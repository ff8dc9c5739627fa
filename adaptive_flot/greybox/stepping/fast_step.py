"""The fast step: exponential time differencing Runge-Kutta of order 4 (ETDRK4), unrolled in SX.

Cox & Matthews, *Exponential time differencing for stiff systems*, J. Comput. Phys. 176 (2002), equations 26 to 29,
with a diagonal linear part: the decay rates that the model gives for its fast states, held at their value at the start
of the step. A state without decay rate gets exactly the classical Runge-Kutta coefficients. The fast modes of a
flotation cell (bubble swarms that leave the pulp within a second) would else ask for three times as many evaluations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import casadi as ca

from adaptive_flot.greybox.model import Model

SERIES_TERMS = 14
"""Terms of the Taylor series of phi_3 and phi_1: error of `exp(-|decay| step)` below 1e-8 up to `|decay| step` = 2,
1e-4 up to 4; a longer step needs substeps, as with any explicit method."""

Symbols = tuple[ca.SX, ca.SX, ca.SX, ca.SX]


@dataclass(frozen=True)
class Moving:
    """A vector and its derivatives along q directions: value (n,), along (n, q). q may be 0."""

    value: ca.SX
    along: ca.SX

    def __add__(self, other: Moving) -> Moving:
        return Moving(self.value + other.value, self.along + other.along)

    def __sub__(self, other: Moving) -> Moving:
        return Moving(self.value - other.value, self.along - other.along)

    def __mul__(self, other: Moving) -> Moving:
        """Elementwise product, by the product rule."""
        along = _scaled(self.value, other.along) + _scaled(other.value, self.along)
        return Moving(self.value * other.value, along)

    def __rmul__(self, factor: float) -> Moving:
        return Moving(factor * self.value, factor * self.along)


def fast_step(model: Model, dt: float | None, substeps: int, options: Mapping[str, bool]) -> ca.Function:
    """Map over one interval, `(x, t, u, p) -> (x_next, y, s)`; y and s at its end.

    The interval lasts dt seconds; for None it is a further input, the last of u. `options` are those of CasADi.
    """
    t, x, u, p = model.ode.sx_in()
    h = ca.SX.sym("dt") if dt is None else dt
    nothing = ca.SX(x.numel(), 0), ca.DM(p.numel(), 0)
    end, y = fast_step_along(model, h, substeps, (x, t, u, p), *nothing)
    s = model.ode(t + h, end.value, u, p)[2]
    names = ["x", "t", "u", "p"], ["x_next", "y", "s"]
    given = ca.vertcat(u, h) if dt is None else u
    return ca.Function("step", [x, t, given, p], [end.value, y.value, s], *names, {**options})


def fast_step_along(
    model: Model, dt: float | ca.SX, substeps: int, symbols: Symbols, moved: ca.SX, seeds: ca.DM
) -> tuple[Moving, Moving]:
    """State and outputs after one interval, with their exact derivatives along q directions.

    Every operation of the step carries its derivative (product and chain rule), so that it is the derivative of the
    step itself. Only the right-hand side is differentiated by CasADi, with the algebraic variable by the implicit
    function rule: three times cheaper than differentiating unrolled Newton iterations.

    Parameters
    ----------
    model
        The model.
    dt
        Length of the interval [s], a number or a symbol.
    substeps
        Steps an interval.
    symbols
        x, t, u, p.
    moved
        Derivative of x along the directions (nx, q).
    seeds
        Derivative of p along them (np, q).
    """
    x, t, u, p = symbols
    q = moved.shape[1]
    h = dt / substeps

    def rates(time: ca.SX, state: Moving) -> tuple[Moving, Moving, Moving]:
        """Slope, outputs and decay rates."""
        if not q:
            xdot, y, _, z = model.ode(time, state.value, u, p)
            decay = model.decay(time, state.value, u, p, z)
            return Moving(xdot, ca.SX(xdot.numel(), 0)), Moving(y, ca.SX(y.numel(), 0)), Moving(decay, state.along)
        # values and derivatives from one function, which has much in common
        xdot, y, decay, *slopes = model.tangent(seeds)(time, state.value, u, p, state.along)
        return Moving(xdot, slopes[0]), Moving(y, slopes[1]), Moving(decay, slopes[2])

    def remainder(time: ca.SX, state: Moving, decay: Moving) -> Moving:
        """Slope without its linear part."""
        return rates(time, state)[0] - decay * state

    # steps of unknown length may be long, and what jumps decays far within any step
    far = tuple(jumps or not isinstance(h, float) for jumps in model.jumping)
    held, w = _has_held_decay(model), None
    end = Moving(x, moved)
    for i in range(substeps):
        start = t + i * h
        slope, _, decay = rates(start, end)
        if w is None or not held:
            w = _weights(decay, h, far)
        n1 = slope - decay * end
        halfway = w.half * end
        a = halfway + w.half_slope * n1
        n2 = remainder(start + h / 2, a, decay)
        b = halfway + w.half_slope * n2
        n3 = remainder(start + h / 2, b, decay)
        c = w.half * a + w.half_slope * (2.0 * n3 - n1)
        n4 = remainder(start + h, c, decay)
        end = w.whole * end + w.first * n1 + w.middle * (n2 + n3) + w.last * n4
    return end, rates(t + dt, end)[1]


def _has_held_decay(model: Model) -> bool:
    """Whether decay rates are the same all through an interval: then the weights are worked out once for all steps."""
    t, x, u, p, z = model.decay.sx_in()
    return not ca.depends_on(model.decay(t, x, u, p, z), ca.vertcat(t, x, z))


@dataclass(frozen=True)
class _Weights:
    """Factors of the state (`half`, `whole`) and of the slopes in the method, each (nx,)."""

    half: Moving
    half_slope: Moving
    whole: Moving
    first: Moving
    middle: Moving
    last: Moving


def _weights(decay: Moving, h: float | ca.SX, far: tuple[bool, ...]) -> _Weights:
    """Weights for z = decay h; for z = 0 those of the classical Runge-Kutta method: 1, h/2, 1, h/6, h/3, h/6.

    `far` says of each state whether its z may be further from zero than the series allows.
    """
    n, q = decay.along.shape
    values = _weights_of(far)(h * decay.value, h)
    if not q:
        return _Weights(*(Moving(v, ca.SX(n, 0)) for v in values))
    # each weight depends on its own decay rate only: one derivative serves all directions
    moved = [_scaled(d * h, decay.along) for d in _slopes_of(far)(h * decay.value, h)]
    return _Weights(*(Moving(v, m) for v, m in zip(values, moved, strict=True)))


@lru_cache(maxsize=128)
def _weights_of(far: tuple[bool, ...]) -> ca.Function:
    """The weights of n states; made once, as it is asked for in every step."""
    z, step = ca.SX.sym("z", len(far)), ca.SX.sym("h")
    return ca.Function("weights", [z, step], weights(z, step, _phi(z, far)))


@lru_cache(maxsize=128)
def _slopes_of(far: tuple[bool, ...]) -> ca.Function:
    """Their derivatives by z."""
    z, step = ca.SX.sym("z", len(far)), ca.SX.sym("h")
    factors = weights(z, step, _phi(z, far))
    return ca.Function("weight_slopes", [z, step], [ca.jtimes(w, z, ca.DM.ones(len(far))) for w in factors])


Phis = tuple[ca.SX, ca.SX, ca.SX, ca.SX]
"""phi_1 to phi_3 of z, and phi_1 of z / 2."""


def weights(z: ca.SX, h: ca.SX, phi: Phis) -> list[ca.SX]:
    """Factors of state and slopes in the method for z = decay h: half, half_slope, whole, first, middle, last.

    `phi` are those near zero (`series_phi`), for other z (`far_phi`), or for any z <= 0 (`closed_phi`).
    """
    phi1, phi2, phi3, phi1_half = phi
    return [
        z / 2 * phi1_half + 1,
        h / 2 * phi1_half,
        z * phi1 + 1,
        h * (phi1 - 3 * phi2 + 4 * phi3),
        2 * h * (phi2 - 2 * phi3),
        h * (4 * phi3 - phi2),
    ]


def series_phi(z: ca.SX) -> Phis:
    """phi_1 to phi_3 of z and phi_1 of z / 2, from phi_k(z) = sum over j of z^j / (j + k)!: no cancellation near 0."""

    def phi(k: int, at: ca.SX) -> ca.SX:
        value = ca.SX(1.0 / factorial(SERIES_TERMS - 1 + k))
        for j in reversed(range(SERIES_TERMS - 1)):  # Horner's rule
            value = value * at + 1.0 / factorial(j + k)
        return value

    phi3 = phi(3, z)
    phi2 = z * phi3 + 0.5
    return z * phi2 + 1, phi2, phi3, phi(1, z / 2)


def far_phi(z: ca.SX) -> Phis:
    """The same for z <= -1: phi_1 = (exp(z) - 1) / z, phi_k+1 = (phi_k - 1 / k!) / z."""
    phi1 = (ca.exp(z) - 1) / z
    phi2 = (phi1 - 1) / z
    return phi1, phi2, (phi2 - 0.5) / z, (ca.exp(z / 2) - 1) / (z / 2)


def closed_phi(z: ca.SX) -> Phis:
    """The same for any z <= 0: the series near 0, else `far_phi`."""
    near = z > -1
    pairs = zip(series_phi(ca.if_else(near, z, 0.0)), far_phi(ca.if_else(near, -1.0, z)), strict=True)
    first, second, third, halved = (ca.if_else(near, small, large) for small, large in pairs)
    return first, second, third, halved


def _phi(z: ca.SX, far: tuple[bool, ...]) -> Phis:
    """phi_1 to phi_3 of z (n,) and phi_1 of z / 2: the closed ones where a state may be far, else the series."""
    if not any(far):
        return series_phi(z)
    each = [closed_phi(z[i]) if is_far else series_phi(z[i]) for i, is_far in enumerate(far)]
    first, second, third, halved = (ca.vertcat(*phis) for phis in zip(*each, strict=True))
    return first, second, third, halved


def _scaled(factors: ca.SX, along: ca.SX) -> ca.SX:
    """Each row of a matrix (n, q) times its own factor (n,); q may be 0."""
    return ca.repmat(factors, 1, along.shape[1]) * along if along.shape[1] else along
