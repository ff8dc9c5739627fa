"""How wide the covariance of the parameters is shown, beyond what the modes claim.

The modes know the direction in which parameters compensate only if the process changes as they describe. Two things
widen what they claim, and neither moves an estimate:

- the *reference*, a fast walk: along no direction is the covariance smaller than a share of the reference's. It covers
  what a record can not show, such as a constant that is off by one percent;
- the *long-run variance of the innovations*. Innovations that stay on one side tell that the parameters move as no mode
  describes. The covariance then grows by it, as that of least squares does (`estimators/shared/colour.py`).
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import FloatArray

CLIP = 3.0
"""Standard deviations beyond which an innovation counts as one of that size: an outlier lasts for one sample."""
TINY, LEAST = 1e-12, 1e-30
"""Share of C and of R, and a variance, that are added to C: what is known exactly is no division by zero."""
SWEEPS = 6
"""Sweeps of Jacobi's method for more than two parameters; two need one rotation. It converges quadratically."""


def no_narrower(q: int) -> ca.Function:
    """The smallest covariance on the common axes of C and `share` R that is smaller than neither, along any direction.

    Both are made diagonal at once, ``C = L L'`` and ``share R = L V W V' L'``; the larger of 1 and each entry of W is
    kept. W is found by cyclic Jacobi rotations (Golub & Van Loan, *Matrix Computations*, 4th edition, section 8.5).

    Returns
    -------
    casadi.Function
        `(C (q, q), R (q, q), share) -> (q, q)`; C positive semidefinite, R positive definite.
    """
    C, R, share = ca.SX.sym("C", q, q), ca.SX.sym("R", q, q), ca.SX.sym("share")
    L = ca.chol(C + TINY * ca.diag(ca.diag(C) + ca.diag(R)) + LEAST * ca.SX.eye(q)).T
    M = share * ca.solve(L, ca.solve(L, R).T)
    axes = ca.SX.eye(q)
    for _ in range(1 if q == 2 else SWEEPS):
        for i in range(q):
            for j in range(i + 1, q):
                turn = _rotation(M, q, i, j)
                M, axes = turn.T @ M @ turn, axes @ turn
    axes = L @ axes
    found = axes @ ca.diag(ca.fmax(ca.diag(M), 1)) @ axes.T
    return ca.Function("no_narrower", [C, R, share], [(found + found.T) / 2], {"cse": True})  # symmetric to the bit


def _rotation(M: ca.SX, q: int, i: int, j: int) -> ca.SX:
    """The rotation in the plane of axes i and j that makes M[i, j] zero."""
    apart, off = M[j, j] - M[i, i], 2 * M[i, j]
    side = ca.if_else(apart < 0, -1, 1)
    tangent = side * off / (ca.fabs(apart) + ca.sqrt(apart**2 + off**2) + 1e-300)
    cosine = 1 / ca.sqrt(1 + tangent**2)
    turn = ca.SX.eye(q)
    turn[i, i] = turn[j, j] = cosine
    turn[i, j], turn[j, i] = tangent * cosine, -tangent * cosine
    return turn


class LongRun:
    """Long-run variance of standardised innovations, sample by sample.

    With a the share by which the running average S moves, b that by which the result does, and w what the variance of S
    would be if the innovations v were white with variance one::

        S += a (v - S),    w = (1 - a)^2 w + a^2,    long_run += b (S^2 / w - long_run)

    a and b follow from the time since the last sample of the output, so that an assay now and then counts as one.

    Parameters
    ----------
    dt
        Sampling interval [s].
    average_s, memory_s
        Time constants of S and of the result [s]. A `memory_s` of 0 leaves the result at one.
    """

    COLUMNS = 4
    """Entries for each output: S, w, the result, and intervals since the last sample."""

    def __init__(self, dt: float, average_s: float, memory_s: float) -> None:
        self.dt, self.average_s, self.memory_s = dt, average_s, memory_s

    @classmethod
    def first(cls, outputs: int) -> FloatArray:
        """Before the first sample (m, 4)."""
        return np.tile([0.0, 0.0, 1.0, 0.0], (outputs, 1))

    def expressions(self, before: ca.MX, innovation: ca.MX, std: ca.MX, present: ca.MX) -> tuple[ca.MX, ca.MX]:
        """`(m, 4)` after a sample, and the factor of the covariance: the largest of the outputs, one at least."""
        if self.memory_s == 0:
            return before, ca.MX(1)
        S, w, long_run, since = (before[:, k] for k in range(self.COLUMNS))
        v = ca.fmin(ca.fmax(innovation / std, -CLIP), CLIP)
        since = since + 1
        a, b = (present * (1 - ca.exp(-since * self.dt / time)) for time in (self.average_s, self.memory_s))
        S, w = S + a * (v - S), (1 - a) ** 2 * w + a**2
        long_run = long_run + b * (S**2 / ca.fmax(w, 1e-300) - long_run)
        return ca.horzcat(S, w, long_run, (1 - present) * since), ca.fmax(ca.mmax(long_run), 1)
