"""Bounded least squares of many problems in step: the method of `scipy.optimize.least_squares`, one evaluation for all.

The trust region reflective method of Branch, Coleman & Li (SIAM J. Sci. Comput. 21 (1999) 1), with the scaling,
radius and tolerances of SciPy's `trf`. Each problem goes the way that SciPy goes with it, to rounding, whatever others
are beside it. One whose way meets a bound or a singular point is given up, for SciPy to solve alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.greybox.model import FloatArray

Mask = NDArray[np.bool_]
TOLERANCE, GRADIENT_TOLERANCE = 1e-10, 1e-8
"""Of cost and step, and of the gradient, as SciPy has them."""
NEAR_A_BOUND = 1e-8
SINGULAR = 1e-12
"""Smallest share of the largest eigenvalue of J'J that is told from zero."""
LM_STEPS, LM_TOLERANCE = 10, 0.01


@dataclass(frozen=True)
class Squares:
    """Sums of squares of M problems with d unknowns at one point each: cost (M,), gradient (M, d) and J'J (M, d, d).

    The cost is NaN where a residual or a derivative is not finite.
    """

    cost: FloatArray
    gradient: FloatArray
    normal: FloatArray

    def where(self, chosen: Mask, other: Squares) -> Squares:
        """These for the problems chosen, the other ones for the rest."""
        return Squares(
            np.where(chosen, self.cost, other.cost),
            np.where(chosen[:, None], self.gradient, other.gradient),
            np.where(chosen[:, None, None], self.normal, other.normal),
        )


@dataclass(frozen=True)
class Solutions:
    """Where the problems ended: unknowns (M, d), evaluations (M,), and whether they converged or were given up (M,)."""

    unknowns: FloatArray
    evaluations: NDArray[np.int64]
    converged: Mask
    given_up: Mask


def solve_in_step(
    evaluate: Callable[[FloatArray, Mask], Squares],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    active: Mask,
    most: int,
) -> Solutions:
    """Minimise the cost of each problem.

    Parameters
    ----------
    evaluate
        Gives the squares at unknowns (M, d) for the problems of a mask; those of others are not looked at.
    start, lower, upper
        Unknowns at the start, and their range (M, d).
    active
        Problems to solve (M,).
    most
        Evaluations of each at the most.
    """
    x, now = start.copy(), evaluate(start, active)
    nfev, converged = active.astype(np.int64), np.zeros(len(x), dtype=bool)
    given_up = active & ~(_inside(x, lower, upper, NEAR_A_BOUND) & np.isfinite(now.cost))
    running = active & ~given_up
    v, _ = _scaling(x, now.gradient, lower, upper)
    delta = np.linalg.norm(x / np.sqrt(v), axis=1)
    delta[delta == 0] = 1.0
    alpha = np.zeros(len(x))
    while True:
        v, dv = _scaling(x, now.gradient, lower, upper)
        done = running & (np.abs(now.gradient * v).max(axis=1, initial=0.0) < GRADIENT_TOLERANCE)
        converged |= done
        running &= ~done & (nfev < most)
        if not running.any():
            return Solutions(x, nfev, converged, given_up)
        d = np.sqrt(v)
        extra, g = now.gradient * dv, d * now.gradient
        B = now.normal * d[:, :, None] * d[:, None, :]
        np.einsum("mii->mi", B)[...] += extra
        B[~running] = np.eye(x.shape[1])
        values, vectors = np.linalg.eigh(B)
        singular = running & ~(values[:, 0] > SINGULAR * values[:, -1])
        given_up, running = given_up | singular, running & ~singular
        values = np.where(running[:, None], values, 1.0)
        p, alpha = _region_step(values, vectors, g, delta, alpha)
        step, trial = d * p, x + d * p
        outside = running & ~_inside(trial, lower, upper, 0.0)
        given_up, running = given_up | outside, running & ~outside
        new = evaluate(np.where(running[:, None], trial, x), running)
        nfev += running
        length = np.linalg.norm(p, axis=1)
        finite = np.isfinite(new.cost)
        promised = -(0.5 * np.einsum("mi,mij,mj->m", p, B, p) + (p * g).sum(axis=1))
        gained = np.where(finite, now.cost - new.cost, -1.0)
        ratio = np.where(promised > 0, gained / np.where(promised > 0, promised, 1.0), (promised == 0) & (gained == 0))
        wider = np.where((ratio > 0.75) & (length > 0.95 * delta), 2.0 * delta, delta)
        next_delta = np.where(ratio < 0.25, 0.25 * length, wider)
        ended = (gained < TOLERANCE * now.cost) & (ratio > 0.25)
        ended |= np.linalg.norm(step, axis=1) < TOLERANCE * (TOLERANCE + np.linalg.norm(x, axis=1))
        ended &= running & finite
        # where the errors are not finite SciPy leaves alpha as it is
        alpha = np.where(finite, alpha * delta / next_delta, alpha)
        delta = next_delta
        accepted = running & (gained > 0)
        x = np.where(accepted[:, None], trial, x)
        now = new.where(accepted, now)
        converged |= ended
        running &= ~ended


def _scaling(x: FloatArray, g: FloatArray, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coleman-Li scaling: distance to the bound that the gradient points away from, and its derivative."""
    down, up = (g < 0) & np.isfinite(upper), (g > 0) & np.isfinite(lower)
    v = np.where(down, upper - x, np.where(up, x - lower, 1.0))
    return v, up.astype(float) - down


def _inside(x: FloatArray, lower: FloatArray, upper: FloatArray, share: float) -> Mask:
    """Whether all unknowns are further from their bounds than a share of the bounds, at least of one."""
    margins = [np.where(np.isfinite(b), share * np.maximum(1.0, np.abs(b)), 0.0) for b in (lower, upper)]
    return np.asarray(((x > lower + margins[0]) & (x < upper - margins[1])).all(axis=1))


def _region_step(
    values: FloatArray, vectors: FloatArray, g: FloatArray, delta: FloatArray, alpha: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Step (M, d) within the trust region and its Levenberg-Marquardt parameter (M,), from the eigenvalues of J'J.

    More, *The Levenberg-Marquardt Algorithm* (1977), as in SciPy.
    """
    turned = np.matmul(vectors.transpose(0, 2, 1), g[:, :, None])[..., 0]
    newton = -np.matmul(vectors, (turned / values)[:, :, None])[..., 0]
    short = np.linalg.norm(newton, axis=1) <= delta
    if short.all():
        return newton, np.zeros_like(alpha)

    def excess(a: FloatArray) -> tuple[FloatArray, FloatArray]:
        denominator = values + a[:, None]
        length = np.linalg.norm(turned / denominator, axis=1)
        return length - delta, -np.sum(turned**2 / denominator**3, axis=1) / length

    with np.errstate(all="ignore"):
        most = np.linalg.norm(turned, axis=1) / delta
        phi, slope = excess(np.zeros_like(alpha))
        least = -phi / slope
        searching = ~short
        for _ in range(LM_STEPS):
            beyond = (alpha < least) | (alpha > most)
            alpha = np.where(searching & beyond, np.maximum(0.001 * most, np.sqrt(least * most)), alpha)
            phi, slope = excess(alpha)
            most = np.where(searching & (phi < 0), alpha, most)
            ratio = phi / slope
            least = np.where(searching, np.maximum(least, alpha - ratio), least)
            alpha = np.where(searching, alpha - (phi + delta) * ratio / delta, alpha)
            searching &= ~(np.abs(phi) < LM_TOLERANCE * delta)
        p = -np.matmul(vectors, (turned / (values + alpha[:, None]))[:, :, None])[..., 0]
        p *= (delta / np.linalg.norm(p, axis=1))[:, None]
    return np.where(short[:, None], newton, p), np.where(short, 0.0, alpha)
