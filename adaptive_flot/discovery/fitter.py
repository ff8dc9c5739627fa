"""Fit one alternative: adapted parameters, initial state and effect coefficients, with its own noise model.

Gauss-Newton with Marquardt damping on exact sensitivities of the whole record, for the criterion of `fit`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

import numpy as np

from adaptive_flot.discovery.fit import Fit, loss_of
from adaptive_flot.discovery.noise import Noise
from adaptive_flot.discovery.problem import Problem
from adaptive_flot.discovery.unknowns import Unknowns
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.record import RecordSimulator

MOST_STEPS = 8
"""Gauss-Newton steps for one noise model."""
NOISE_ROUNDS = 3
MOST_DIRECTIONS = 4
"""Combinations of the initial state that are free: those that the record tells most about."""
TELLING = 3.0
"""A combination counts when a change by one scale moves the outputs by this many standard deviations in all."""
TOLERANCE = 0.1
"""A step that improves minus two log-likelihood by less ends the search: a fortieth of what any test asks for."""
SLOW = 2e-3
"""Or one that improves it by less than this share of what the search has gained so far."""


class Fitter:
    """Fits of alternatives to one problem. Immutable; every call is independent."""

    def __init__(self, problem: Problem, share: tuple[str, ...] = ("estimate",)) -> None:
        self.problem = problem
        self.rows = problem.rows(*share)
        self.count = int(np.isfinite(problem.measured[self.rows]).sum())

    def fit(
        self,
        model: Model,
        free: tuple[str, ...] = (),
        start: Mapping[str, float] | None = None,
        like: Fit | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        rounds: int = NOISE_ROUNDS,
        steps: int = MOST_STEPS,
    ) -> Fit | None:
        """Fit the adapted parameters, the initial state and the parameters `free`.

        Parameters
        ----------
        model
            The model, with its effects.
        free
            Further free parameters, by full name.
        start
            Values to start from, by full name; else those of `like`, else the model's.
        like
            A fit of a simpler model, whose parameters and initial state are the start.
        bounds
            Narrower ranges by full name: an onset inside the record.
        rounds
            How often the noise model is fitted again.
        steps
            Most Gauss-Newton steps for one noise model.

        Returns
        -------
        Fit or None
            None when the model can not simulate the record from the start values.
        """
        unknowns = Unknowns(self.problem, model, free, start or {}, like, bounds or {})
        return _Search(self, model, unknowns).run(rounds, steps, like)


class _Search:
    """One search."""

    def __init__(self, fitter: Fitter, model: Model, unknowns: Unknowns) -> None:
        self.fitter, self.problem, self.model, self.unknowns = fitter, fitter.problem, model, unknowns
        self.simulator = RecordSimulator(model, fitter.problem.record.dt)

    def _predict(self, z: FloatArray) -> FloatArray:
        p, x0 = self.unknowns.unpack(z)
        return self.simulator.outputs(self.problem.record, x0, p)[:, self.problem.columns]

    def _jacobian(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predictions (N, m) and their derivatives (N, m, unknowns)."""
        p, x0 = self.unknowns.unpack(z)
        gradient = self.unknowns.initial_gradient()
        y, dy, _ = self.simulator.sensitivities(self.problem.record, x0, p, self.unknowns.names, gradient)
        columns = list(self.problem.columns)
        dy[:, :, : self.unknowns.q] *= self.unknowns.scale
        return y[:, columns], dy[:, columns, :]

    def _objective(self, z: FloatArray, predicted: FloatArray, noise: Noise) -> float:
        if not np.all(np.abs(predicted) < 1e100):
            return np.inf
        value = loss_of(self.problem, predicted, self.fitter.rows, noise)[0]
        return value + float(np.sum(((z - self.unknowns.prior_centre) / self.unknowns.prior) ** 2))

    # -- search --------------------------------------------------------------------------------------------------------

    def run(self, rounds: int, steps: int, like: Fit | None) -> Fit | None:
        if like is None:
            self.unknowns.turn(self._telling_directions())
        z = self.unknowns.centre.copy()
        predicted, slope = self._jacobian(z)
        if not (np.isfinite(predicted).all() and _moderate(slope)):
            return None
        noise = self._first_noise()
        for turn in range(rounds):
            z, predicted, slope = self._descend(z, predicted, slope, noise, steps)
            if turn < rounds - 1:
                before = noise
                noise = loss_of(self.problem, predicted, self.fitter.rows)[1]
                if turn and _alike(before, noise):
                    break
        return self._result(z, predicted, slope)

    def _telling_directions(self) -> FloatArray:
        """Directions (nx, r) of the initial state, in scales of the states, that the record tells most about."""
        scale = np.array([s.scale for s in self.model.states])
        self.unknowns.turn(np.diag(scale))
        _, slope = self._jacobian(self.unknowns.centre)
        weighted = slope[:, :, self.unknowns.q :] / (self.problem.weights * self._white_std())[:, :, None]
        rows = weighted[self.fitter.rows].reshape(-1, len(scale))
        if not np.isfinite(rows).all():
            return np.zeros((len(scale), 0))
        strength, turned = np.linalg.eigh(rows.T @ rows)
        telling = [i for i in np.argsort(-strength)[:MOST_DIRECTIONS] if strength[i] > TELLING**2]
        return cast(FloatArray, scale[:, None] * turned[:, telling])

    def _white_std(self) -> FloatArray:
        """Noise by differencing: it needs no model."""
        weighted = self.problem.measured / self.problem.weights
        d = np.diff(weighted, axis=0)
        found = np.array([np.nanmedian(np.abs(c)) * 1.4826 / np.sqrt(2) for c in d.T])
        return cast(FloatArray, np.maximum(np.nan_to_num(found), self.problem.floor))

    def _first_noise(self) -> Noise:
        """White, and large: the first steps must not be steered by what a wrong model leaves."""
        return Noise(np.maximum(3 * self._white_std(), self.problem.floor), np.zeros((len(self.problem.columns), 1)))

    def _descend(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise, steps: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        value = first = self._objective(z, predicted, noise)
        damping = 1e-3
        for _ in range(steps):
            step_of = self._step(z, predicted, slope, noise)
            accepted = False
            while damping < 1e8:
                trial = np.clip(z + step_of(damping), self.unknowns.lower, self.unknowns.upper)
                there = self._predict(trial)
                new = self._objective(trial, there, noise)
                if new < value:
                    accepted = True
                    break
                damping *= 10
            if not accepted:
                break
            gained, z, value, predicted = value - new, trial, new, there
            damping = max(damping / 10, 1e-9)
            if gained < max(TOLERANCE, SLOW * (first - value)):
                break
            predicted, fresh = self._jacobian(z)
            if not _moderate(fresh):
                break
            slope = fresh
        return z, predicted, slope

    def _system(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise
    ) -> tuple[FloatArray, FloatArray]:
        """Normal equations (A, b) of the whitened, clipped, regularised problem."""
        rows, w = self.fitter.rows, self.problem.weights
        e = noise.whiten((self.problem.measured - predicted) / w)[rows]
        J = noise.whiten(slope / w[:, :, None])[rows]
        present = np.isfinite(e)
        inside = present & (np.abs(np.where(present, e, 0)) <= self.problem.clip)
        e = np.where(inside, e, 0)[inside]
        J = J[inside]
        prior = 1 / self.unknowns.prior**2
        A = J.T @ J + np.diag(prior)
        b = J.T @ e - prior * (z - self.unknowns.prior_centre)
        return A, b

    def _step(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise
    ) -> Callable[[float], FloatArray]:
        A, b = self._system(z, predicted, slope, noise)
        size = np.diag(A) + 1e-12 * np.max(np.diag(A))
        at_lower = (z <= self.unknowns.lower) & (b < 0)
        at_upper = (z >= self.unknowns.upper) & (b > 0)
        move = ~(at_lower | at_upper)

        def step(damping: float) -> FloatArray:
            found = np.zeros(len(b))
            system = A[np.ix_(move, move)] + damping * np.diag(size[move])
            found[move] = np.linalg.solve(system, b[move])
            return found

        return step

    def _result(self, z: FloatArray, predicted: FloatArray, slope: FloatArray) -> Fit | None:
        if not np.isfinite(predicted).all():
            return None
        problem, rows = self.problem, self.fitter.rows
        loss, noise = loss_of(problem, predicted, rows)
        A, _ = self._system(z, predicted, slope, noise)
        inverse = np.linalg.pinv(A, hermitian=True)[: self.unknowns.q, : self.unknowns.q]
        covariance = cast(FloatArray, inverse * np.outer(self.unknowns.scale, self.unknowns.scale))
        p, x0 = self.unknowns.unpack(z)
        values = p[self.unknowns.where]
        fitted = self.model.with_parameters(dict(zip(self.unknowns.names, map(float, values), strict=True)))
        penalty = len(self.unknowns.names) * np.log(max(self.fitter.count, 2))
        innovations = noise.whiten((problem.measured - predicted) / problem.weights)
        return Fit(
            fitted,
            self.unknowns.names,
            values,
            covariance,
            x0,
            predicted,
            innovations,
            noise,
            loss,
            loss + float(penalty),
            self.unknowns.directions,
        )


def _moderate(slope: FloatArray) -> bool:
    """Whether a derivative can be squared: a run near the edge of stability has larger ones."""
    return bool(np.all(np.abs(slope) < 1e100))


def _alike(a: Noise, b: Noise) -> bool:
    return np.allclose(a.std, b.std, rtol=0.01) and np.allclose(a.lags, b.lags, atol=0.02)
