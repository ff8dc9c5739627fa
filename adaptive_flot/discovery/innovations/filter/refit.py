"""A model in innovations form, fitted to one record: constants and coefficients by Gauss-Newton, noise in between.

The steps are those of the prediction error method with the derivatives of the filter at its present gain: Ljung,
*System Identification* (1999), 10.2. Weights of Student's t: Lange, Little & Taylor, *J. Am. Stat. Assoc.* 84 (1989)
881.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student_t

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants, at_rest
from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.discovery.innovations.filter.free_parameters import LOOSE, FreeParameters
from adaptive_flot.discovery.innovations.filter.linear_response import LinearResponse, ResponseFunctions, weight_of
from adaptive_flot.discovery.innovations.filter.noise_fit import Costs, noise_of, search_noise_along
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering import Filtered, NoiseModel
from adaptive_flot.greybox.filtering.likelihood import first_state
from adaptive_flot.greybox.model import FloatArray, Model

NU = 5.0
"""Degrees of freedom of the innovations."""
ITERATIONS = 8
SHARES = (1.0, 0.5, 0.2, 0.05)
"""Shares of a step that are tried in turn."""
ENOUGH, LARGE = 0.05, 5.0
"""Gain below which a fit is where it stays, and below which the noise is searched for again."""
OUTLIER, USUAL = 5.0, 3.0
"""Standard deviations of an innovation beyond which it is an outlier where those beside it are at most usual."""
UNSURE = 3.0
"""Standard deviation of the state before the first row, in scales of the states."""
HOPELESS = 1e12
STRETCHES = 5
"""Stretches of a record that are compared for the covariance of a parameter."""
KEPT = 3
"""Runs of the filter that are kept."""
DIFFERENCE = 0.05
"""Width of a difference of the cost, in standard deviations of a parameter."""


@dataclass(frozen=True)
class Refit:
    """A model in innovations form, fitted. It holds no equations, so that it goes from one process to another.

    Attributes
    ----------
    p
        Parameters (np,).
    noise, size
        Process and measurement noise, and their factors theta and rho, see `search_noise`.
    filtered
        What the filter makes of the record.
    log_likelihood
        Over the rows that fitted, and less the priors.
    at_rest
        Whether its last step gained nothing that counts.
    """

    p: FloatArray
    noise: NoiseModel
    size: tuple[float, float]
    filtered: Filtered
    log_likelihood: float
    at_rest: bool = True

    @property
    def rows(self) -> FloatArray:
        """Log-likelihood of each row (N,)."""
        return self.filtered.log_likelihood


class Refitter:
    """Fits of one model structure to one record.

    Parameters
    ----------
    model
        The model with its effects.
    record
        The record, without a gap.
    columns
        Indices of the outputs that count (m,).
    floor
        Noise of these from row to row (m,).
    free
        Names of the free parameters.
    known
        What is known of some of them before.
    counted
        Rows that fit (N,); default all. The filter runs over all of them.
    degrees_of_freedom
        Of the innovations; infinity is the Gaussian filter.
    held
        Factors of the noise that no fit changes; None where they are fitted.
    """

    def __init__(
        self,
        model: Model,
        record: Dataset,
        columns: Sequence[int],
        floor: FloatArray,
        free: Sequence[str],
        known: Constants | None = None,
        counted: BoolArray | None = None,
        degrees_of_freedom: float = NU,
        held: tuple[float, float] | None = None,
    ) -> None:
        self.model, self.record, self.columns, self.floor = model, record, tuple(columns), floor
        self.degrees_of_freedom, self.held = degrees_of_freedom, held
        self.free, self.known = tuple(free), known
        self.counted = np.ones(len(record), dtype=bool) if counted is None else counted
        self._functions = ResponseFunctions(model, record.dt, columns, (), free, degrees_of_freedom)
        self._filter = self._functions.filter
        self.space = FreeParameters(model, free, known)
        self._where, self._scale = self.space.where, self.space.scale
        self._runs: dict[tuple[bytes, tuple[float, float]], Filtered] = {}

    def start(self, noise: NoiseModel, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """State and covariance before the first row."""
        z, P = first_state(self.model, self.record, noise, p)
        return at_rest(self.model, z, self.record), UNSURE**2 * P

    def noise(self, size: tuple[float, float]) -> NoiseModel:
        """Noise of a size."""
        return noise_of(self.model, self.floor, self.columns, self.record.dt, *size, self.degrees_of_freedom)

    def fit(
        self,
        p: FloatArray,
        size: tuple[float, float] | None = None,
        *,
        hold_noise: bool = False,
        iterations: int = ITERATIONS,
    ) -> Refit:
        """Fit from parameters (np,) and, where they are known nearly, factors of the noise, which may be held."""
        p = self.space.inside(p)
        first = p[self._where].copy()
        if size is None or not hold_noise:
            size, best = self._search_noise(p, first, size)
        else:
            best = self._cost(p, size, first)
        at_rest = not self.free
        for i in range(iterations if self.free else 0):
            before = best
            p, best = self._moved(p, size, first, best)
            if not hold_noise and (before - best < LARGE or i % 2):
                for near in (True, False):  # all over again only where all else has come to rest
                    size, best = self._search_noise(p, first, size, best, near=near)
                    if before - best >= ENOUGH:
                        break
            at_rest = before - best < ENOUGH
            if at_rest:
                break
        return Refit(p, self.noise(size), size, self._run_at(p, size), -best, at_rest)

    def costs(self, points: FloatArray, size: tuple[float, float]) -> FloatArray:
        """Costs (k,) at several parameters (k, np), each in range, with factors of the noise."""
        inside = self.space.inside(points)
        return np.array(self._costs([(p, size) for p in inside], inside[0, self._where]))

    def at(self, p: FloatArray) -> Refit:
        """The noise fitted at parameters (np,) that stay."""
        first = p[self._where].copy()
        size, cost = self._search_noise(p, first)
        return Refit(p.copy(), self.noise(size), size, self._run_at(p, size), -cost)

    def response(self, fit: Refit, sites: Sequence[str]) -> LinearResponse:
        """How the innovations of a fit, of a Gaussian filter, answer at sites, with the free parameters beside.

        Single outliers are missing values there: a Gaussian filter believes them, and one may outweigh all other rows.
        """
        functions = ResponseFunctions(self.model, self.record.dt, self.columns, sites, self.free)
        outputs, columns = self.record.outputs.copy(), list(self.columns)
        off = single_outliers(outputs[:, columns] - fit.filtered.predicted, fit.filtered.variance)
        outputs[:, columns] = np.where(off, np.nan, outputs[:, columns])
        record = replace(self.record, outputs=outputs)
        return functions.at(record, fit.noise, fit.p, self.start(fit.noise, fit.p))

    def run(self, p: FloatArray, noise: NoiseModel) -> Filtered:
        """The filter over the record."""
        with np.errstate(all="ignore"):
            return self._filter.run(self.record, noise, *self.start(noise, p), p)

    def _run_at(self, p: FloatArray, size: tuple[float, float]) -> Filtered:
        """The filter over the record; the last few runs are kept, as a step begins where the one before was tried."""
        key = p.tobytes(), size
        if key not in self._runs:
            while len(self._runs) >= KEPT:
                del self._runs[next(iter(self._runs))]
            self._runs[key] = self.run(p, self.noise(size))
        return self._runs[key]

    def _cost(self, p: FloatArray, size: tuple[float, float], first: FloatArray) -> float:
        return self._totals(self._run_at(p, size).log_likelihood[None], [p], first)[0]

    def _costs(self, points: Sequence[tuple[FloatArray, tuple[float, float]]], first: FloatArray) -> list[float]:
        """Costs at several parameters and sizes of the noise, whose filters run side by side."""
        with np.errstate(all="ignore"):
            rows = self._filter.log_likelihoods(self.record, self._cases(points))
        return self._totals(rows, [p for p, _ in points], first)

    def _cases(
        self, points: Sequence[tuple[FloatArray, tuple[float, float]]]
    ) -> list[tuple[NoiseModel, FloatArray, FloatArray, FloatArray]]:
        return [(noise := self.noise(size), *self.start(noise, p), p) for p, size in points]

    def _totals(self, rows: FloatArray, points: Sequence[FloatArray], first: FloatArray) -> list[float]:
        """Costs of parameters (np,) by the log-likelihoods of all rows (k, N)."""
        totals = [
            -float(own.sum()) + float(np.sum(self.space.prior(p[self._where], first) ** 2)) / 2
            for own, p in zip(rows[:, self.counted], points, strict=True)
        ]
        return [total if np.isfinite(total) else HOPELESS for total in totals]

    def _search_noise(
        self,
        p: FloatArray,
        first: FloatArray,
        size: tuple[float, float] | None = None,
        best: float | None = None,
        *,
        near: bool = False,
    ) -> tuple[tuple[float, float], float]:
        """The size of the noise of least cost at some parameters, and that cost; from a size and its cost.

        The size that is held, where one is.
        """
        if self.held is not None:
            return self.held, self._cost(p, self.held, first)

        def along(middle: tuple[float, float]) -> Costs:
            run = self._run_at(p, middle)

            def costs(sizes: Sequence[tuple[float, float]]) -> list[float]:
                points = [(p, size) for size in sizes]
                with np.errstate(all="ignore"):
                    rows = self._filter.log_likelihoods_near(run, self.record, self._cases(points))
                return self._totals(rows, [p] * len(sizes), first)

            return costs

        def costs(sizes: Sequence[tuple[float, float]]) -> list[float]:
            if len(sizes) == 1:  # the course of the next search
                return [self._cost(p, sizes[0], first)]
            return self._costs([(p, each) for each in sizes], first)

        return search_noise_along(costs, along, size, best, near=near)

    def _moved(
        self, p: FloatArray, size: tuple[float, float], first: FloatArray, best: float
    ) -> tuple[FloatArray, float]:
        """Parameters after one step, and their cost; where none is better, those from before.

        The gain moves with the parameters, so that a step at the present gain may lead up: a late sensor beside process
        noise is such a case. Then the slopes of the cost itself show the way, too.
        """
        A, b = self._normal_equations(p, size, first)
        if not (np.isfinite(A).all() and np.isfinite(b).all()):
            return p, best
        step = self.space.step(p, A, b)
        (whole,) = self.space.stepped(p, step, SHARES[:1])
        value = self._cost(whole, size, first)  # mostly the best; the next step needs all of its run
        if value < best:
            return whole, value
        by_slopes = self.space.step(p, A, -self._slopes(p, size, first, best, A))
        tried = [*self.space.stepped(p, step, SHARES[1:]), *self.space.stepped(p, by_slopes, SHARES)]
        values = self._costs([(q, size) for q in tried], first)
        least = int(np.argmin(values))
        return (tried[least], values[least]) if values[least] < best else (p, best)

    def _slopes(
        self, p: FloatArray, size: tuple[float, float], first: FloatArray, best: float, A: FloatArray
    ) -> FloatArray:
        """Slopes of the cost along the free parameters, in their scales (q,), by differences to one side.

        With the curvature that the normal equations A have, from the cost `best` at p::

            slope = (cost(p + d) - best) / d - A d / 2

        A difference d is a share (DIFFERENCE) of what these take for one standard deviation.
        """
        away = DIFFERENCE / np.sqrt(np.diag(A))
        x = p[self._where]
        away = np.where(x + away * self._scale > self.space.upper, -away, away)
        points = np.tile(p, (len(x), 1))
        points[np.arange(len(x)), self._where] = x + away * self._scale
        inside = self.space.inside(points)
        values = np.array(self._costs([(q, size) for q in inside], first))
        told = (values < HOPELESS) & (inside == points).all(axis=1)
        slopes: FloatArray = np.where(told, (values - best) / away - np.diag(A) * away / 2, 0.0)
        return slopes

    def covariance(self, fit: Refit) -> FloatArray:
        """Covariance of the free parameters at a fit (q, q): the inverse of the normal equations."""
        A, _ = self._normal_equations(fit.p, fit.size, fit.p[self._where])
        return np.asarray(np.linalg.pinv(A, hermitian=True) * np.outer(self._scale, self._scale), dtype=np.float64)

    def robust_covariance(self, fit: Refit) -> FloatArray:
        """The same (q, q), where a parameter differs between stretches by more than the noise: as far as they differ.

        With the scores s_b of B stretches, each the sum over its rows of the slopes of the log-likelihood::

            R = A^-1 (sum_b s_b s_b') A^-1 B / (B - 1)

        Liang & Zeger, *Biometrika* 73 (1986) 13. Variances are at least those of the normal equations A, and R's count
        (t / 1.96)^2 times, with the 97.5 % point t of Student's t for B - 1 degrees of freedom: so ±1.96 standard
        deviations are a 95 % interval. What wanders more slowly than a stretch is seen in part.
        """
        A, _ = self._normal_equations(fit.p, fit.size, fit.p[self._where])
        inverse = np.linalg.pinv(A, hermitian=True)
        L = self._functions.at(self.record, fit.noise, fit.p, self.start(fit.noise, fit.p))
        pull = np.repeat(self.counted[1:], len(self.columns)) * L.innovations
        scores = L.by_constants * self._scale * (pull * weight_of(L.innovations**2, self.degrees_of_freedom))[:, None]
        sums = np.array([b.sum(axis=0) for b in np.array_split(scores, STRETCHES)])
        robust = np.diag(inverse @ sums.T @ sums @ inverse) * STRETCHES / (STRETCHES - 1)
        robust = robust * (student_t.ppf(0.975, STRETCHES - 1) / norm.ppf(0.975)) ** 2
        wider = np.sqrt(np.maximum(robust / np.maximum(np.diag(inverse), 1e-300), 1.0)) * self._scale
        return np.asarray(inverse * np.outer(wider, wider), dtype=np.float64)

    def _normal_equations(
        self, p: FloatArray, size: tuple[float, float], first: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Normal equations (A, b) of a step, in scales of the free parameters."""
        noise = self.noise(size)
        L = self._functions.along(self.record, noise, p, self._run_at(p, size))
        counts = np.repeat(self.counted[1:], len(self.columns))
        w = counts * weight_of(L.innovations**2, self.degrees_of_freedom)
        J, x = L.by_constants * self._scale, p[self._where]
        prior = self.space.prior(x, first)
        D = np.vstack([np.eye(len(x)) / LOOSE, self.space.known_rows(p)[0] * self._scale])
        return (J * w[:, None]).T @ J + D.T @ D, (J * w[:, None]).T @ L.innovations - D.T @ prior


def single_outliers(innovation: FloatArray, variance: FloatArray) -> BoolArray:
    """Innovations (N, m) of a filter by Student's t that no measured one beside them goes with (N, m).

    After a step the filter is as far off for some rows more, so that a step is none.
    """
    size = np.nan_to_num(np.abs(innovation) / np.sqrt(variance))
    beside = np.zeros_like(size)
    beside[1:] = size[:-1]
    beside[:-1] = np.maximum(beside[:-1], size[1:])
    found: BoolArray = (size > OUTLIER) & (beside <= USUAL)
    return found
