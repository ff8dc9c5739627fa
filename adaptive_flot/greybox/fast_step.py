"""The fast step: exponential time differencing Runge-Kutta of order 4 (ETDRK4), unrolled in SX.

Cox & Matthews, *Exponential time differencing for stiff systems*, J. Comput. Phys. 176 (2002), equations 26 to 29,
with a diagonal linear part: the decay rates that the model gives for its fast states, held at their value at the start
of the step. A state without decay rate gets exactly the classical Runge-Kutta coefficients. The fast modes of a
flotation cell (bubble swarms that leave the pulp within a second) would else ask for three times as many evaluations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

import casadi as ca

from adaptive_flot.greybox.model import Model

SERIES_TERMS = 14
"""Terms of the Taylor series of phi_3 and phi_1: error of exp(-|decay| step) below 1e-8 up to |decay| step = 2, 1e-4 up
to 4; a longer step needs substeps, as with any explicit method."""

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
        q = self.along.shape[1]
        along = [self.value * other.along[:, j] + self.along[:, j] * other.value for j in range(q)]
        return Moving(self.value * other.value, _columns(along, self.value.numel()))

    def __rmul__(self, factor: float) -> Moving:
        return Moving(factor * self.value, factor * self.along)


def fast_step(model: Model, dt: float, substeps: int) -> ca.Function:
    """Map over one interval of dt seconds, `(x, t, u, p) -> (x_next, y, s)`; y and s at its end."""
    t, x, u, p = model.ode.sx_in()
    nothing = ca.SX(x.numel(), 0), ca.DM(p.numel(), 0)
    end, y = fast_step_along(model, dt, substeps, (x, t, u, p), *nothing)
    s = model.ode(t + dt, end.value, u, p)[2]
    names = ["x", "t", "u", "p"], ["x_next", "y", "s"]
    return ca.Function("step", [x, t, u, p], [end.value, y.value, s], *names, {"cse": True})


def fast_step_along(
    model: Model, dt: float, substeps: int, symbols: Symbols, moved: ca.SX, seeds: ca.DM
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
        Length of the interval [s].
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
        xdot, y, _, z = model.ode(time, state.value, u, p)
        decay = model.decay(time, state.value, u, p, z)
        if not q:
            return Moving(xdot, ca.SX(xdot.numel(), 0)), Moving(y, ca.SX(y.numel(), 0)), Moving(decay, state.along)
        slopes = model.tangent(q)(time, state.value, u, p, z, state.along, seeds)
        return Moving(xdot, slopes[0]), Moving(y, slopes[1]), Moving(decay, slopes[2])

    def remainder(time: ca.SX, state: Moving, decay: Moving) -> Moving:
        """Slope without its linear part."""
        return rates(time, state)[0] - decay * state

    end = Moving(x, moved)
    for i in range(substeps):
        start = t + i * h
        slope, _, decay = rates(start, end)
        w = _weights(decay, h)
        n1 = slope - decay * end
        a = w.half * end + w.half_slope * n1
        n2 = remainder(start + h / 2, a, decay)
        b = w.half * end + w.half_slope * n2
        n3 = remainder(start + h / 2, b, decay)
        c = w.half * a + w.half_slope * (2.0 * n3 - n1)
        n4 = remainder(start + h, c, decay)
        end = w.whole * end + w.first * n1 + w.middle * (n2 + n3) + w.last * n4
    return end, rates(t + dt, end)[1]


@dataclass(frozen=True)
class _Weights:
    """Factors of the state (`half`, `whole`) and of the slopes in the method, each (nx,)."""

    half: Moving
    half_slope: Moving
    whole: Moving
    first: Moving
    middle: Moving
    last: Moving


def _weights(decay: Moving, h: float) -> _Weights:
    """Weights for z = decay h; for z = 0 those of the classical Runge-Kutta method: 1, h/2, 1, h/6, h/3, h/6."""
    n, q = decay.along.shape
    z, dz = ca.SX.sym("z", n), ca.SX.sym("dz", n, q)
    phi3 = _series(z, 3)
    phi2 = z * phi3 + 0.5
    phi1 = z * phi2 + 1
    phi1_half = _series(z / 2, 1)
    weights = [
        z / 2 * phi1_half + 1,
        h / 2 * phi1_half,
        z * phi1 + 1,
        h * (phi1 - 3 * phi2 + 4 * phi3),
        2 * h * (phi2 - 2 * phi3),
        h * (4 * phi3 - phi2),
    ]
    values = ca.Function("weights", [z], weights)(h * decay.value)
    if not q:
        return _Weights(*(Moving(v, ca.SX(n, 0)) for v in values))
    slopes = ca.Function("weight_slopes", [z, dz], [ca.jtimes(w, z, dz) for w in weights])
    moved = slopes(h * decay.value, h * decay.along)
    return _Weights(*(Moving(v, m) for v, m in zip(values, moved, strict=True)))


def _series(z: ca.SX, k: int) -> ca.SX:
    """phi_k(z) = sum over j of z^j / (j + k)!, by Horner's rule: no cancellation near 0."""
    value = ca.SX(1.0 / factorial(SERIES_TERMS - 1 + k))
    for j in reversed(range(SERIES_TERMS - 1)):
        value = value * z + 1.0 / factorial(j + k)
    return value


def _columns(columns: Sequence[ca.SX], n: int) -> ca.SX:
    return ca.horzcat(*columns) if columns else ca.SX(n, 0)
