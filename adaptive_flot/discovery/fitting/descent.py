"""The search for one fit: each alternative has its own noise model, fitted in turn with its unknowns.

Gauss-Newton with Marquardt damping on sensitivities of the whole record, for the criterion of `fit`. With whitened
innovations e, derivatives J of the predictions by the unknowns z, and a weak prior N(z0, P)::

    A = J'J + P^-1      b = J'e - P^-1 (z - z0)      (A + damping diag A) step = b

Marquardt, *SIAM J. Appl. Math.* 11 (1963) 431.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit, loss_of
from adaptive_flot.discovery.fitting.normal_equations import NormalEquations
from adaptive_flot.discovery.fitting.unknowns import DIRECTION_PRIOR, Unknowns
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.graded_nodes import GradedNodes
from adaptive_flot.greybox.stepping.nodes import Nodes, Substeps
from adaptive_flot.greybox.stepping.record import RecordSimulator

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e4
SHAPE_DAMPING = 0.1
"""First damping where an onset or a time constant is free: an undamped step throws it out of the record."""
MOST_DIRECTIONS = 6
"""Combinations of the initial state that are free: those that the record tells most about."""
TELLING = 3.0
"""A combination counts when a change by one scale moves the outputs by this many standard deviations in all."""
TOLERANCE = 0.1
"""A step that improves minus two log-likelihood by less ends the search: a fortieth of what any test asks for."""
SLOW = 2e-3
"""Or one that improves it by less than this share of what the search has gained so far."""
RUN_AWAY = 1e6
"""Scales by which a state moves at most: a run that moves it more has left all bounds."""
FAR_OFF = 0.01
"""A run is far off when no larger a share of the measurements is within what the first steps look at."""
KEPT, SHAPE_KEPT = 0.5, 0.8
"""Derivatives are kept after a step that gains more than this share of what they promised; those by an onset or a time
constant change more."""

BACKGROUND_STEPS = 2
"""Steps that end on the best background."""
START_FRACTIONS = (1.0, 0.3, 0.1)
"""Fractions of a first-order estimate that are tried as the start."""
SMALL_FRACTIONS = (0.03, 0.01, 0.0)
"""Those that are tried where no model runs with these: nothing at all, in the end."""


def nodes_for(problem: Problem, model: Model) -> Nodes | None:
    """Where a model is simulated; None for every row by the model's own steps.

    An effect that is abrupt would be lost between nodes that leave rows out, but not between steps within a row.
    """
    nodes = problem.nodes
    if not any(e.family.abrupt for e in model.effects) or isinstance(nodes, Substeps):
        return nodes
    return (nodes.every_row or nodes) if isinstance(nodes, GradedNodes) else None


class Descent:
    """One search: the fit of one model to the rows that are true (N,), for some unknowns."""

    def __init__(self, problem: Problem, rows: BoolArray, model: Model, unknowns: Unknowns) -> None:
        self.problem, self.rows, self.model, self.unknowns = problem, rows, model, unknowns
        self.simulator = RecordSimulator(model, problem.record.dt, nodes_for(problem, model))
        background = problem.background
        # what the model has of it already is the same for all predictions
        self._first_background = np.zeros(0) if background is None else background.first(model)
        self._equations = NormalEquations(problem, rows, unknowns)

    def _predict(self, z: FloatArray) -> FloatArray:
        p, x0 = self.unknowns.unpack(z)
        return self._with_background(z, self.simulator.outputs(self.problem.record, x0, p)[:, self.problem.columns])

    def _with_background(self, z: FloatArray, free: FloatArray) -> FloatArray:
        """A free run (N, m), and what the background adds to it."""
        background = self.problem.background
        if background is None:
            return free
        return free + background.change(z[self.unknowns.first_of_background :] - self._first_background)

    def _jacobian(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predictions (N, m) and their derivatives (N, m, unknowns) but those by the background, which never change."""
        p, x0 = self.unknowns.unpack(z)
        gradient = self.unknowns.initial_gradient()
        y, dy, _ = self.simulator.sensitivities(self.problem.record, x0, p, self.unknowns.names, gradient)
        columns = list(self.problem.columns)
        dy[:, :, : self.unknowns.q] *= self.unknowns.scale
        return self._with_background(z, y[:, columns]), dy[:, columns, :]

    def _objective(self, z: FloatArray, predicted: FloatArray, noise: Noise) -> float:
        if not np.all(np.abs(predicted) < 1e100):
            return np.inf
        value = loss_of(self.problem, predicted, self.rows, noise)[0]
        return value + float(np.sum(((z - self.unknowns.prior_centre) / self.unknowns.prior) ** 2))

    # -- search --------------------------------------------------------------------------------------------------------

    def shrink(self, names: Sequence[str]) -> None:
        """Start from smaller values of these unknowns where these are nearer: a first-order estimate may be far off."""
        where = [self.unknowns.names.index(n) for n in names]
        noise, centre = self._first_noise(), self.unknowns.centre
        for fractions in (START_FRACTIONS, SMALL_FRACTIONS):
            starts = []
            for fraction in fractions:
                z = centre.copy()
                z[where] *= fraction
                z = np.clip(z, self.unknowns.lower, self.unknowns.upper)
                starts.append((self._objective(z, self._predict(z), noise), z))
            least, self.unknowns.centre = min(starts, key=lambda start: start[0])
            if np.isfinite(least):
                return

    def run(self, rounds: int, steps: int, first: bool, noise: Noise | None = None) -> Fit | None:
        """Steps for as many noise models as `rounds`; `first` chooses the directions of the initial state itself.

        They begin with a `noise` model that is given, or with white noise that is large.
        """
        if first:
            self.unknowns.turn(self._telling_directions())
        z = self.unknowns.centre.copy()
        predicted, slope = self._jacobian(z)
        if not (np.isfinite(predicted).all() and _moderate(slope)):
            return None
        noise, exact = noise or self._first_noise(predicted), True
        for turn in range(rounds):
            if not exact:
                predicted, slope = self._derived(z, predicted, slope)
            z, predicted, slope, exact = self._descend(z, predicted, slope, noise, steps)
            if turn < rounds - 1:
                before = noise
                noise = loss_of(self.problem, predicted, self.rows)[1]
                if turn and _alike(before, noise):
                    break
        return self._result(z, predicted, slope)

    def _derived(self, z: FloatArray, predicted: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Predictions and exact derivatives at z, or what there is where these are beyond all bounds."""
        there, fresh = self._jacobian(z)
        return (there, fresh) if _moderate(fresh) else (predicted, slope)

    def _telling_directions(self) -> FloatArray:
        """Directions (nx, r) of the initial state, in scales of the states, that the record tells most about."""
        spread, prior = np.diag([s.scale for s in self.model.states]), DIRECTION_PRIOR
        if not (self.model.starts_steady or self.problem.record.initial_state is not None):
            spread, prior = self._start_at_first_row(), 1.0
        self.unknowns.turn(spread)
        _, slope = self._jacobian(self.unknowns.centre)
        weighted = slope[:, :, self.unknowns.q :] / (self.problem.weights * self._white_std())[:, :, None]
        rows = weighted[self.rows].reshape(-1, len(spread))
        if not np.isfinite(rows).all():
            return np.zeros((len(spread), 0))
        strength, turned = np.linalg.eigh(rows.T @ rows)
        telling = [i for i in np.argsort(-strength)[:MOST_DIRECTIONS] if strength[i] > TELLING**2]
        return cast(FloatArray, spread @ turned[:, telling] * prior / DIRECTION_PRIOR)

    def _start_at_first_row(self) -> FloatArray:
        """Move the first guess to where the first row has it, and return what stays open of it, as a root (nx, nx).

        Where much is missing, a fit of the start alone may come to an absurd one, and all fits that begin there stay.
        The guess x of a process that does not start at rest may be as far off as its states move, P = diag(d^2). With
        the outputs y of the first row, their derivatives H = dh/dx, and R of their noise or, as a sensor may be off, of
        their scale, it is as in a Kalman filter::

            K = P H' (H P H' + R)^-1      x + K (y - h(x))      P - K H P
        """
        record, columns = self.problem.record, list(self.problem.columns)
        p, x0 = self.unknowns.unpack(self.unknowns.centre)
        scale = np.array([s.scale for s in self.model.states])
        moved = np.std(self.simulator.states(record, x0, p), axis=0)
        spread = np.where(moved < RUN_AWAY * scale, np.maximum(scale, moved), scale)
        y, H = self.simulator.first_outputs(record, x0, p)
        error, H = record.outputs[0, columns] - y[columns], H[columns]
        there = np.isfinite(error) & np.isfinite(H).all(axis=1)
        if not there.any():
            return np.diag(spread)
        sizes = np.array([self.model.outputs[c].scale for c in columns])
        noise = np.maximum(self._white_std() * self.problem.weights[0], sizes)
        H, error = H[there] * spread, error[there]  # in units of the spread: P is the identity
        K = np.linalg.solve(H @ H.T + np.diag(noise[there] ** 2), H).T
        self.unknowns.x0 = self.unknowns.first_guess = x0 + spread * (K @ error)
        values, vectors = np.linalg.eigh(np.eye(len(spread)) - K @ H)
        return cast(FloatArray, spread[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))

    def _white_std(self) -> FloatArray:
        """Noise by differencing: it needs no model."""
        deviations = noise_by_differences(self.problem.measured / self.problem.weights)
        return cast(FloatArray, np.maximum(np.nan_to_num(deviations), self.problem.floor))

    def _first_noise(self, predicted: FloatArray | None = None) -> Noise:
        """White, and large: the first steps must not be steered by what a wrong model leaves.

        As large as the error itself where a prediction is so far off that next to nothing would count.
        """
        std = np.maximum(3 * self._white_std(), self.problem.floor)
        if predicted is not None:
            off = np.abs((self.problem.measured - predicted) / self.problem.weights)[self.rows]
            seen = np.isfinite(off)
            if np.sum(off[seen] <= (self.problem.clip * std * np.ones_like(off))[seen]) < FAR_OFF * seen.sum():
                std = np.maximum(std, np.nan_to_num(np.nanmedian(off, axis=0)))
        return Noise(std, np.zeros((len(self.problem.columns), 1)))

    def _descend(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise, steps: int
    ) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
        """Steps for one noise model: what they come to, its predictions, their derivatives, and if these are exact.

        Derivatives cost three times what a prediction does. While a step gains about what it promised they are kept,
        and corrected by what the step has shown (Broyden 1965, *Math. Comp.* 19:577). Only exact ones end the search.
        """
        value = first = self._objective(z, predicted, noise)
        shaped = self.unknowns.shaped
        damping, exact = SHAPE_DAMPING if shaped else FIRST_DAMPING, True
        for _ in range(steps):
            if self.problem.time_is_up:
                break
            A, b = self._equations.system(z, predicted, slope, noise)
            gain_step = self._tried(z, value, noise, self._step(z, A, b), damping)
            if gain_step is None and exact:
                break
            if gain_step is not None:
                trial, there, new, damping = gain_step
                moved, gained = trial - z, value - new
                promised = float(2 * b @ moved - moved @ A @ moved)
                kept = gained > (SHAPE_KEPT if shaped else KEPT) * promised
                if kept:
                    slope = self._corrected(slope, moved, there - predicted, np.diag(A))
                done = gained < max(TOLERANCE, SLOW * (first - new))
                z, value, predicted = trial, new, there
                enough, exact = done and exact, False
                if enough:
                    break
                if kept and not done:
                    continue
            there, fresh = self._jacobian(z)
            if not _moderate(fresh):
                break
            predicted, slope, exact = there, fresh, True
        return z, predicted, slope, exact

    def _corrected(self, slope: FloatArray, moved: FloatArray, change: FloatArray, weight: FloatArray) -> FloatArray:
        """Derivatives that give the `change` (N, m) of the predictions along the step that made it.

        What the background does is linear: its derivatives are right, and what it has changed is taken off.
        """
        own, rest = np.split(moved, [self.unknowns.first_of_background])
        if self.problem.background is not None:
            change = change - self.problem.background.change(rest)
        along = weight[: len(own)] * own
        updated: FloatArray = slope + (change - slope @ own)[:, :, None] * (along / max(float(own @ along), 1e-300))
        return updated

    def _tried(
        self, z: FloatArray, value: float, noise: Noise, step_of: Callable[[float], FloatArray], damping: float
    ) -> tuple[FloatArray, FloatArray, float, float] | None:
        """The first step of rising damping that gains: where it ends, predictions, criterion, damping for the next.

        The next starts lower only where the first try gained: else it would fail where this one just did.
        """
        tried = damping
        while tried < MOST_DAMPING:
            trial = np.clip(z + step_of(tried), self.unknowns.lower, self.unknowns.upper)
            there = self._predict(trial)
            new = self._objective(trial, there, noise)
            if new < value:
                return trial, there, new, max(tried / 10, LEAST_DAMPING) if tried == damping else tried
            tried *= 10
        return None

    def _step(self, z: FloatArray, A: FloatArray, b: FloatArray) -> Callable[[float], FloatArray]:
        """Step (unknowns,) for a damping; what is at a limit and pulled beyond it stays."""
        size = np.diag(A) + 1e-12 * np.max(np.diag(A), initial=0.0)
        at_lower = (z <= self.unknowns.lower) & (b < 0)
        at_upper = (z >= self.unknowns.upper) & (b > 0)
        move = ~(at_lower | at_upper)

        def step(damping: float) -> FloatArray:
            moves = np.zeros(len(b))
            if not A.any():
                return moves  # the record says nothing of any unknown
            system = A[np.ix_(move, move)] + damping * np.diag(size[move])
            moves[move] = np.linalg.solve(system, b[move])
            return moves

        return step

    def _with_best_background(
        self, z: FloatArray, predicted: FloatArray, slope: FloatArray, noise: Noise
    ) -> tuple[FloatArray, FloatArray]:
        """Unknowns and predictions with the best background beside the rest, for a noise model: a linear problem."""
        if self.problem.background is None:
            return z, predicted
        own = slice(self.unknowns.first_of_background, None)
        for _ in range(BACKGROUND_STEPS):  # which values are clipped may change
            A, b = self._equations.system(z, predicted, slope, noise)
            moved = np.zeros(len(z))
            moved[own] = np.linalg.solve(A[own, own], b[own])
            z, predicted = z + moved, predicted + self.problem.background.change(moved[own])
        return z, predicted

    def _result(self, z: FloatArray, predicted: FloatArray, slope: FloatArray) -> Fit | None:
        if not np.isfinite(predicted).all():
            return None
        problem, rows = self.problem, self.rows
        loss, noise = loss_of(problem, predicted, rows)
        z, predicted = self._with_best_background(z, predicted, slope, noise)
        if problem.background is not None:
            loss, noise = loss_of(problem, predicted, rows)
        A, _ = self._equations.system(z, predicted, slope, noise)
        first = self.unknowns.first_of_background
        background = z[first:]
        if problem.background is not None:
            loss += float(background @ background) + float(np.linalg.slogdet(A[first:, first:])[1])
        inverse = np.asarray(np.linalg.pinv(A, hermitian=True), dtype=np.float64)
        own = inverse[: self.unknowns.q, : self.unknowns.q]
        covariance = own * np.outer(self.unknowns.scale, self.unknowns.scale)
        p, x0 = self.unknowns.unpack(z)
        values = p[self.unknowns.where]
        fitted = self.model.with_parameters(dict(zip(self.unknowns.names, map(float, values), strict=True)))
        penalty = len(self.unknowns.names) * np.log(max(problem.count(rows), 2))
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
            background,
            inverse[first:, first:],
            self.unknowns.first_guess,
        )


def _moderate(slope: FloatArray) -> bool:
    """Whether a derivative can be squared: a run near the edge of stability has larger ones."""
    return bool(np.all(np.abs(slope) < 1e100))


def _alike(a: Noise, b: Noise) -> bool:
    return np.allclose(a.std, b.std, rtol=0.01) and np.allclose(a.lags, b.lags, atol=0.02)
