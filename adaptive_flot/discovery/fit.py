"""Fit one alternative: adapted parameters, initial state and effect coefficients, with its own noise model.

Output error (free run) with whitened, clipped innovations: the criterion of Ljung, *System Identification*, 2nd ed.,
(7.12) with Huber's norm (15.9). Gauss-Newton with Marquardt damping on exact sensitivities of the whole record.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from adaptive_flot.discovery.noise import Noise
from adaptive_flot.discovery.problem import BoolArray, Problem
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.record import RecordSimulator
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.protocols import full_parameters

MOST_STEPS = 8
"""Gauss-Newton steps for one noise model."""
NOISE_ROUNDS = 3
MOST_DIRECTIONS = 4
"""Combinations of the initial state that are free: those that the record tells most about."""
TELLING = 3.0
"""A combination counts when a change by one scale moves the outputs by this many standard deviations in all."""
SLOW = 2e-3
"""Or one that improves it by less than this share of what the search has gained so far."""
DIRECTION_PRIOR = 5.0
"""Standard deviation of the weak prior of a direction of the initial state, in units of the states' scales."""
PRIOR_SCALES = 20.0
"""Standard deviation of the weak prior of an effect's coefficients, in units of their scale."""
TOLERANCE = 0.1
"""A step that improves minus two log-likelihood by less ends the search: a fortieth of what any test asks for."""


@dataclass(frozen=True)
class Fit:
    """A fitted alternative.

    Attributes
    ----------
    model
        The model with the fitted parameters.
    names
        Free parameters (q,), the adapted ones first.
    values, covariance
        Their values (q,) and covariance (q, q), each in its unit.
    initial_state
        State at the first row (nx,).
    predicted
        Free run (N, m) of the measured outputs.
    innovations
        Whitened innovations (N, m) in standard deviations, NaN where missing.
    noise
        Noise model of the residual.
    loss
        Minus two log-likelihood on the rows fitted (up to a constant of the record).
    bic
        `loss` + free parameters x log(number of measurements).
    """

    model: Model
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    initial_state: FloatArray
    predicted: FloatArray
    innovations: FloatArray
    noise: Noise
    loss: float
    bic: float
    directions: FloatArray
    """Free combinations of the initial state (nx, r): those the record can tell; the rest keeps its first guess."""

    def residual(self, problem: Problem) -> FloatArray:
        """Measured minus predicted (N, m)."""
        r: FloatArray = problem.measured - self.predicted
        return r

    def std(self) -> FloatArray:
        """Standard deviation of each free parameter (q,)."""
        return np.sqrt(np.diag(self.covariance))


def loss_of(
    problem: Problem, predicted: FloatArray, rows: BoolArray, noise: Noise | None = None
) -> tuple[float, Noise]:
    """Minus two log-likelihood on some rows; with the noise model given, or fitted to these rows."""
    weighted = (problem.measured - predicted) / problem.weights
    noise = noise or problem.noise(weighted, rows)
    e = noise.whiten(weighted)[rows]
    present = np.isfinite(e)
    squares = np.minimum(np.abs(np.where(present, e, 0)), problem.clip) ** 2
    return float(np.sum(squares) + 2 * np.sum(np.log(noise.std) * present.sum(axis=0))), noise


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
        return _Search(self, model, free, dict(start or {}), like, bounds or {}).run(rounds, steps, like)


class _Search:
    """One search. Unknowns z: the free parameters over their scale, then the free directions of the initial state."""

    def __init__(
        self,
        fitter: Fitter,
        model: Model,
        free: tuple[str, ...],
        start: dict[str, float],
        like: Fit | None,
        bounds: Mapping[str, tuple[float, float]],
    ) -> None:
        problem = fitter.problem
        self.fitter, self.problem, self.model = fitter, problem, model
        self.simulator = RecordSimulator(model, problem.record.dt)
        self.names = (*problem.adapted, *(n for n in free if n not in problem.adapted))
        self.where = model.indices("parameters", self.names)
        parameters = [model.parameters[i] for i in self.where]
        if like is not None:
            start = {**{p.name: p.value for p in like.model.parameters}, **start}
        self.base = np.array([start.get(p.name, p.value) for p in model.parameters])
        self.x0 = self._first_state(like)
        self.q = len(self.names)
        self.scale = np.array([p.scale for p in parameters])
        low = [max(p.lower, bounds.get(p.name, (-np.inf, np.inf))[0]) for p in parameters]
        high = [min(p.upper, bounds.get(p.name, (-np.inf, np.inf))[1]) for p in parameters]
        shapes = {e.parameter(c.name) for e in model.effects for c in e.terms if c.shape}
        unbound = [i < len(problem.adapted) or p.name in shapes for i, p in enumerate(parameters)]
        self._range = np.array(low) / self.scale, np.array(high) / self.scale
        self._prior = np.where(unbound, np.inf, PRIOR_SCALES)
        self._prior_centre = np.array([p.value for p in parameters]) / self.scale
        directions = np.zeros((len(self.x0), 0)) if like is None else like.directions
        self._turn(np.vstack([directions, np.zeros((len(self.x0) - len(directions), directions.shape[1]))]))

    def _turn(self, directions: FloatArray) -> None:
        """Make these directions (nx, r) of the initial state the free ones."""
        r = directions.shape[1]
        self.directions = directions
        self.lower = np.concatenate([self._range[0], np.full(r, -np.inf)])
        self.upper = np.concatenate([self._range[1], np.full(r, np.inf)])
        self.prior = np.concatenate([self._prior, np.full(r, DIRECTION_PRIOR)])
        self.prior_centre = np.concatenate([self._prior_centre, np.zeros(r)])
        start = np.concatenate([self.base[self.where] / self.scale, np.zeros(r)])
        self.centre = np.clip(start, self.lower, self.upper)

    def _first_state(self, like: Fit | None) -> FloatArray:
        record, n = self.problem.record, len(self.model.states)
        if record.initial_state is not None and n == len(record.initial_state):
            return record.initial_state
        if like is not None:
            known = like.initial_state
        else:
            guess = np.array([self.model.initial_guess.get(s.name, s.scale) for s in self.model.states])
            if not self.model.starts_steady:
                return guess
            try:
                known = steady_state(self.model, record.inputs[0], self.base).state
            except RangeError:
                return guess
        if len(known) == n:
            return known.copy()
        return self._settled_filters(known)

    def _settled_filters(self, known: FloatArray) -> FloatArray:
        """Initial state with the states of new effects where they are at rest beside the known ones."""
        record, nx = self.problem.record, len(self.model.states)
        x = np.concatenate([known, np.ones(nx - len(known))])
        new = slice(len(known), nx)
        arguments = record.time[0], x, record.inputs[0], self.base
        slope = np.array(self.model.ode.factory("slope", ["t", "x", "u", "p"], ["jac:xdot:x"])(*arguments))
        rate = np.array(self.model.ode(*arguments)[0]).ravel()
        x[new] -= np.linalg.lstsq(slope[new, new], rate[new], rcond=None)[0]
        return x

    # -- evaluation ----------------------------------------------------------------------------------------------------

    def _unpack(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters (np,) and initial state (nx,), kept inside the physical range of each state."""
        p = self.base.copy()
        p[self.where] = z[: self.q] * self.scale
        x0 = self.x0 + self.directions @ z[self.q :]
        lower = np.array([s.lower for s in self.model.states])
        upper = np.array([s.upper for s in self.model.states])
        return p, cast(FloatArray, np.clip(x0, lower, upper))

    def _predict(self, z: FloatArray) -> FloatArray:
        p, x0 = self._unpack(z)
        return self.simulator.outputs(self.problem.record, x0, p)[:, self.problem.columns]

    def _jacobian(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predictions (N, m) and their derivatives (N, m, unknowns)."""
        p, x0 = self._unpack(z)
        gradient = np.hstack([np.zeros((len(x0), self.q)), self.directions])
        y, dy, _ = self.simulator.sensitivities(self.problem.record, x0, p, self.names, gradient)
        columns = list(self.problem.columns)
        dy[:, :, : self.q] *= self.scale
        return y[:, columns], dy[:, columns, :]

    def _objective(self, z: FloatArray, predicted: FloatArray, noise: Noise) -> float:
        if not np.all(np.abs(predicted) < 1e100):
            return np.inf
        value = loss_of(self.problem, predicted, self.fitter.rows, noise)[0]
        return value + float(np.sum(((z - self.prior_centre) / self.prior) ** 2))

    # -- search --------------------------------------------------------------------------------------------------------

    def run(self, rounds: int, steps: int, like: Fit | None) -> Fit | None:
        if like is None:
            self._turn(self._telling_directions())
        z = self.centre.copy()
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
        self._turn(np.diag(scale))
        _, slope = self._jacobian(self.centre)
        weighted = slope[:, :, self.q :] / (self.problem.weights * self._white_std())[:, :, None]
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
                trial = np.clip(z + step_of(damping), self.lower, self.upper)
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
        prior = 1 / self.prior**2
        A = J.T @ J + np.diag(prior)
        b = J.T @ e - prior * (z - self.prior_centre)
        return A, b

    def _step(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise
    ) -> Callable[[float], FloatArray]:
        A, b = self._system(z, predicted, slope, noise)
        size = np.diag(A) + 1e-12 * np.max(np.diag(A))
        at_lower = (z <= self.lower) & (b < 0)
        at_upper = (z >= self.upper) & (b > 0)
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
        inverse = np.linalg.pinv(A, hermitian=True)[: self.q, : self.q]
        covariance = cast(FloatArray, inverse * np.outer(self.scale, self.scale))
        p, x0 = self._unpack(z)
        values = p[self.where]
        fitted = self.model.with_parameters(dict(zip(self.names, map(float, values), strict=True)))
        penalty = len(self.names) * np.log(max(self.fitter.count, 2))
        innovations = noise.whiten((problem.measured - predicted) / problem.weights)
        return Fit(
            fitted,
            self.names,
            values,
            covariance,
            x0,
            predicted,
            innovations,
            noise,
            loss,
            loss + float(penalty),
            self.directions,
        )


def _moderate(slope: FloatArray) -> bool:
    """Whether a derivative can be squared: a run near the edge of stability has larger ones."""
    return bool(np.all(np.abs(slope) < 1e100))


def _alike(a: Noise, b: Noise) -> bool:
    return np.allclose(a.std, b.std, rtol=0.01) and np.allclose(a.lags, b.lags, atol=0.02)


def parameters_of(fit: Fit) -> FloatArray:
    """Full parameter vector (np,) of a fit."""
    return full_parameters(fit.model, fit.names, fit.values)
