"""Mixing, correction and combination of M Gaussian filters, as expressions for one compiled function.

All filters share one linearisation, at their mean; each keeps its own mean and covariance. With one filter this is the
extended Kalman filter. Means stand side by side (n, M). Of the covariances only the lower triangle is kept, one column
for each filter (n (n + 1) / 2, M). Equations: Blom & Bar-Shalom, IEEE Trans. Automatic Control 33 (1988); Bar-Shalom,
Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), section 11.6.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from adaptive_flot.greybox.model import FloatArray

REACH = 3.0
"""A value beyond so many standard deviations of an outlier widens it: one absurd value moves nothing far."""
Indices = npt.NDArray[np.int_]


class Triangles:
    """Lower triangles of symmetric matrices (n, n) in columns, by whole rows at a time."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.rows, self.columns = (np.array(i) for i in np.tril_indices(n))
        position = np.zeros((n, n), dtype=int)
        position[self.rows, self.columns] = position[self.columns, self.rows] = np.arange(len(self.rows))
        self._position = position
        self.diagonal: Indices = position.diagonal().copy()

    def products(self, a: ca.MX, b: ca.MX) -> ca.MX:
        """Triangles of the symmetric matrices ``a_k b_k'`` of columns of a and b (n, M)."""
        return a[self.rows.tolist(), :] * b[self.columns.tolist(), :]

    def whole(self, triangles: ca.MX) -> ca.MX:
        """The matrices side by side (n, n M)."""
        return ca.reshape(triangles[self._position.ravel(order="F").tolist(), :], self.n, -1)

    def of(self, matrices: ca.MX, count: int) -> ca.MX:
        """Triangles of symmetric matrices that stand side by side (n, n M)."""
        return ca.reshape(matrices, self.n**2, count)[(self.rows + self.n * self.columns).tolist(), :]

    def transposed(self, matrices: ca.MX, count: int) -> ca.MX:
        """Each of the matrices that stand side by side (n, n M), transposed."""
        order = np.arange(self.n**2).reshape(self.n, self.n, order="F").T.ravel(order="F")
        return ca.reshape(ca.reshape(matrices, self.n**2, count)[order.tolist(), :], self.n, -1)

    def on_diagonal(self, variances: FloatArray) -> FloatArray:
        """Triangles of diagonal matrices with these variances in columns (n, M)."""
        found = np.zeros((len(self.rows), variances.shape[1]))
        found[self.diagonal] = variances
        return found


@dataclass(frozen=True)
class Mixing:
    """How filters hand on what they know when the mode changes.

    Attributes
    ----------
    transitions
        Probability of going from mode i to mode j (M, M).
    entry
        Variance of the rates when a mode begins (M, n).
    rates, discrepancies
        Where they lie in z.
    off
        1 for a mode that has discrepancies, else 0 (M,).
    """

    transitions: FloatArray
    entry: FloatArray
    rates: slice
    discrepancies: slice
    off: FloatArray

    def expressions(self, z: ca.MX, P: ca.MX, probability: ca.MX, widths: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Means, covariances and predicted probabilities (M,) before the next interval.

        A mode that begins takes over states and parameters. Its rates start anew, and so do its discrepancies unless
        the mode before had some; `widths` (m, M) are their variances.
        """
        n, modes = z.shape
        shape = Triangles(n)
        predicted = ca.DM(self.transitions.T) @ probability
        weights = ca.DM(self.transitions) * (probability @ (1 / ca.fmax(predicted, 1e-300)).T)
        stay, both = np.eye(modes), np.maximum(np.outer(self.off, self.off), np.eye(modes))
        stays = weights * ca.DM(stay)
        share = ca.sum1(stays)
        fresh = np.zeros(n)
        fresh[self.discrepancies], fresh[self.rates] = 1, 2
        middle = z @ probability / ca.sum1(probability) * ca.DM((fresh == 0).astype(float))
        away = z - ca.repmat(middle, 1, modes)
        second = P + shape.products(away, away)
        by = [weights, weights * ca.DM(both), stays]  # what every mode hands on, what some do, what only the same does
        mean = _grouped(away, fresh, by)
        mixed = _grouped(second, np.maximum(fresh[shape.rows], fresh[shape.columns]), by)
        mixed -= shape.products(mean, mean)
        mixed += ca.DM(shape.on_diagonal(self.entry.T)) * ca.repmat(1 - share, len(shape.rows), 1)
        begun = ca.sum1(weights * ca.DM(1 - both))
        return (
            ca.repmat(middle, 1, modes) + mean,
            mixed + widened(widths * ca.repmat(begun, widths.shape[0], 1), shape),
            predicted,
        )


def widened(variances: ca.MX, shape: Triangles) -> ca.MX:
    """Triangles with the variances (m, M) of the last m entries of z on the diagonal."""
    m = variances.shape[0]
    place = np.zeros((len(shape.rows), m))
    place[shape.diagonal[-m:], np.arange(m)] = 1
    return ca.sparsify(ca.DM(place)) @ variances


def _grouped(values: ca.MX, groups: FloatArray, by: list[ca.MX]) -> ca.MX:
    """Rows of `values` (k, M) of each group times its own matrix (M, M)."""
    order = [np.flatnonzero(groups == g) for g in range(len(by))]
    found = [values[rows.tolist(), :] @ matrix for rows, matrix in zip(order, by, strict=True) if rows.size]
    back = np.argsort(np.concatenate(order))
    return ca.vertcat(*found)[back.tolist(), :]


@dataclass(frozen=True)
class Corrected:
    """Filters after a sample: means (n, M), covariances, log-likelihoods (1, M), shares believed (m, M)."""

    away: ca.MX
    P: ca.MX
    log_likelihood: ca.MX
    believed: ca.MX


@dataclass(frozen=True)
class Contamination:
    """Measurement noise with outliers: ``(1 - share) N(0, r^2) + share N(0, (scale r)^2)``.

    A value is weighed between both by Bayes' rule, and the mixture of the two corrections is matched by its mean and
    covariance. Source: Huber, Annals of Mathematical Statistics 35 (1964) 73, for the noise; Bar-Shalom, Li &
    Kirubarajan (2001), section 1.4.16, for the moments.
    """

    share: float
    scale: float

    def correct(self, away: ca.MX, P: ca.MX, H: ca.MX, residual: ca.MX, variance: ca.MX, present: ca.MX) -> Corrected:
        """Correct by one output after the other.

        Parameters
        ----------
        away, P
            Means less the point of linearisation (n, M), and covariances.
        H
            Derivatives of the m outputs (m, n).
        residual
            Measured less predicted at the point of linearisation (m,).
        variance
            Of the noise (m,).
        present
            1 where an output was measured, else 0 (m,).
        """
        shape, modes = Triangles(away.shape[0]), away.shape[1]
        log_likelihood, believed = ca.MX.zeros(1, modes), []
        for j in range(H.shape[0]):
            row = H[j, :]
            spread = ca.reshape(row @ shape.whole(P), shape.n, modes)
            own, r2 = row @ spread, variance[j]
            error = residual[j] - row @ away
            narrow = own + r2
            if self.share > 0:
                wide = own + ca.fmax(self.scale**2 * r2, (error / REACH) ** 2)
                right = _log_normal(error, narrow) + np.log(1 - self.share)
                wrong = _log_normal(error, wide) + np.log(self.share)
                both = ca.fmax(right, wrong) + ca.log1p(ca.exp(-ca.fabs(right - wrong)))
                good = ca.exp(right - both)
                weight = good / narrow + (1 - good) / wide
                shrink = weight - good * (1 - good) * ((1 / narrow - 1 / wide) * error) ** 2
            else:
                both, good = _log_normal(error, narrow), ca.MX.ones(1, modes)
                weight = 1 / narrow
                shrink = weight
            away = away + spread * ca.repmat(present[j] * weight * error, shape.n, 1)
            P = P - shape.products(spread * ca.repmat(present[j] * shrink, shape.n, 1), spread)
            log_likelihood += present[j] * both
            believed.append(good)
        return Corrected(away, P, log_likelihood, ca.vertcat(*believed))


def _log_normal(error: ca.MX, variance: ca.MX) -> ca.MX:
    return -(ca.log(2 * np.pi * variance) + error**2 / variance) / 2


def output_variance(H: ca.MX, P: ca.MX, modes: int) -> ca.MX:
    """Variance ``diag(H P H')`` that each mode expects of the outputs, their noise apart (m, M)."""
    shape = Triangles(H.shape[1])
    whole = shape.whole(P)
    rows = [H[j, :] @ ca.reshape(H[j, :] @ whole, shape.n, modes) for j in range(H.shape[0])]
    return ca.vertcat(*rows)


def carried(P: ca.MX, F: ca.MX, modes: int) -> ca.MX:
    """Covariances ``F P F'`` after an interval."""
    shape = Triangles(F.shape[0])
    half = shape.transposed(F @ shape.whole(P), modes)
    return shape.of(F @ half, modes)


def combined(z: ca.MX, P: ca.MX, probability: ca.MX, shown: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Mean (n,) of the mixture, and covariance (n, n) about it of a mixture with the weights `shown` (M,)."""
    shape = Triangles(z.shape[0])
    mean = z @ probability
    away = z - ca.repmat(mean, 1, z.shape[1])
    return mean, shape.whole((P + shape.products(away, away)) @ shown)


def matched(
    variance: ca.MX, count: ca.MX, corrected: Corrected, probability: ca.MX, H: ca.MX, residual: ca.MX, present: ca.MX
) -> ca.MX:
    """Variance of the noise of each output (m,), one sample later: ``r^2 += (e^2 + H P H' - r^2) / count``.

    e and P are those after the correction. The mean over the modes, each value weighed by how far it is believed.
    Source: covariance matching on residuals, Mohamed & Schwarz, Journal of Geodesy 73 (1999) 193, equation 24.
    """
    modes = probability.shape[0]
    left = ca.repmat(residual, 1, modes) - H @ corrected.away
    seen = (left**2 + output_variance(H, corrected.P, modes)) * corrected.believed
    good = corrected.believed @ probability
    return variance + present * (seen @ probability - good * variance) / count
