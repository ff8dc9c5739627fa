"""One model fitted to several records at once, each with an initial state of its own, by robust least squares.

Unknowns are coefficients of a hypothesis, the model's constants, which keep to what a reference says of them, and the
initial states. Derivatives are differences of runs: a run takes milliseconds, a function for exact derivatives would
have to be made anew for every hypothesis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from adaptive_flot.discovery.hypotheses.known_before import Constants, first_states
from adaptive_flot.discovery.hypotheses.rows import TAIL, Rows
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator

STATE_PRIOR = 1.0
"""Standard deviation of the prior of the initial state, in the scales of the states."""
EDGE = 1e-9
DIFFERENCE = 1e-4
"""Step of differences, in scales of the unknowns."""
MOST_EVALUATIONS = 15


@dataclass(frozen=True)
class JointFit:
    """A fit, without the model's equations: it goes from one process to another.

    Attributes
    ----------
    values
        All parameters of the model by name, the fitted ones too.
    coefficients
        Names of the fitted coefficients (q,).
    unknowns
        Everything that was fitted, in units of the prior or the scale: coefficients (q,), constants (c,), initial
        states (nx,) of each record.
    jacobian
        Derivatives of the scaled errors and the priors by these.
    initial
        Initial state of each record (nx,).
    errors
        Measured minus free run of each record (N, m).
    cost
        Criterion over the rows that counted, and the priors.
    """

    values: Mapping[str, float]
    coefficients: tuple[str, ...]
    unknowns: FloatArray
    jacobian: FloatArray
    initial: tuple[FloatArray, ...]
    errors: tuple[FloatArray, ...]
    cost: float

    def value(self, name: str) -> float:
        """Fitted value of a parameter."""
        return self.values[name]


class JointFitter:
    """Fits of one model structure (the model and its effects) to the same records.

    Parameters
    ----------
    model
        The model with its effects.
    rows
        Records and rows.
    constants
        Constants that are fitted too, and what is known of them.
    coefficients
        Names of the coefficients that are fitted.
    initial
        First guess of the initial states; its uncertainty is the scale of the states.

    Raises
    ------
    ModelError
        No record, or records of different sampling intervals.
    """

    def __init__(
        self,
        model: Model,
        rows: Rows,
        constants: Constants,
        coefficients: Sequence[str] = (),
        initial: Sequence[FloatArray] = (),
    ) -> None:
        if not rows.records:
            raise ModelError("a joint fit needs a record; give at least one")
        intervals = [record.dt for record in rows.records]
        if max(intervals) - min(intervals) > 1e-6 * max(intervals):
            raise ModelError(
                f"records are sampled every {min(intervals):g} s and every {max(intervals):g} s; "
                "resample them to one interval"
            )
        self.model, self.rows, self.constants, self.coefficients = model, rows, constants, tuple(coefficients)
        self._last: tuple[FloatArray, tuple[FloatArray, ...]] | None = None
        self._simulator = RecordSimulator(model, intervals[0])
        self._initial = tuple(initial) or first_states(model, rows.records)
        self._own = model.indices("parameters", self.coefficients)
        self._shared = model.indices("parameters", constants.names)
        self._scale = np.array([model.parameters[i].scale or 1.0 for i in self._own])
        self._state_scale = np.array([s.scale for s in model.states])
        self._lower = np.array([p.lower for p in model.parameters])
        self._upper = np.array([p.upper for p in model.parameters])
        scales = np.array([model.parameters[i].scale or 1.0 for i in self._shared])
        # how many scales the constants move with each of their unknowns; a difference moves them by a small part of one
        self._reach = np.maximum(1.0, np.abs(constants.root / scales[:, None]).max(axis=0, initial=0.0))
        each = np.broadcast_to(rows.memory, len(rows.columns))
        self._memory = np.concatenate([np.tile(each, len(r)) for r in rows.records])
        self._sizes = (len(self._own), len(self._shared), len(model.states))

    def on(self, rows: Rows) -> JointFitter:
        """The same fitter on other rows of the same records: the model's functions are not made again."""
        other = copy(self)
        other.rows, other._last = rows, None
        return other

    def prior(self, z: FloatArray) -> FloatArray:
        """Residuals of the priors of constants and initial states."""
        residuals: FloatArray = z[self._sizes[0] :] * self._weights()
        return residuals

    @property
    def memory(self) -> FloatArray:
        """Rows that count as one, of each residual of the data."""
        return self._memory

    def inside(self, z: FloatArray) -> FloatArray:
        """The unknowns with their coefficients inside their bounds."""
        q, moved = self._sizes[0], z.copy()
        moved[:q] = np.clip(z[:q], self._lower[self._own] / self._scale, self._upper[self._own] / self._scale)
        return moved

    def start(self, values: Mapping[str, float] | None = None) -> FloatArray:
        """Unknowns with these coefficients, the model's own else, and everything else at its prior."""
        _, c, nx = self._sizes
        known = values or {}
        own = [known.get(n, self.model.parameters[i].value) for n, i in zip(self.coefficients, self._own, strict=True)]
        return np.concatenate([np.array(own) / self._scale, np.zeros(c + nx * len(self.rows.records))])

    def extended(self, fit: JointFit, values: Mapping[str, float]) -> FloatArray:
        """Unknowns of another fit of the same constants and records, with coefficients of one's own before them."""
        z = self.start(values)
        q, c, nx = self._sizes
        theirs, count = len(fit.coefficients), len(fit.initial[0])
        z[q : q + c] = fit.unknowns[theirs : theirs + c]
        for i in range(len(self.rows.records)):
            block = fit.unknowns[theirs + c + i * count : theirs + c + (i + 1) * count]
            z[q + c + i * nx : q + c + i * nx + count] = block
        return z

    def errors(self, z: FloatArray) -> tuple[FloatArray, ...]:
        """Measured minus free run of each record (N, m)."""
        p = self._parameters(z)
        errors = tuple(self._errors_of(i, p, z) for i in range(len(self.rows.records)))
        self._last = (z.copy(), errors)
        return errors

    def cost(self, z: FloatArray, errors: Sequence[FloatArray]) -> float:
        """Criterion of errors over the rows that count, and the priors of constants and initial states."""
        return float(np.sum(self.prior(z) ** 2)) + float(sum(loss.sum() for loss in self.rows.losses(errors)))

    def fit(
        self, z: FloatArray, *, most: int = MOST_EVALUATIONS, refresh: int = 1, shared: FloatArray | None = None
    ) -> JointFit:
        """Fit everything that is unknown.

        Parameters
        ----------
        z
            Unknowns to start from, see `start`.
        most
            Most evaluations of the derivatives.
        refresh
            Derivatives by constants and initial states are taken anew every so many evaluations: they change little.
        shared
            These derivatives from a fit that is near, see `shared_slopes`: they are not taken anew.
        """
        q = self._sizes[0]
        lower, upper = np.full(len(z), -np.inf), np.full(len(z), np.inf)
        lower[:q], upper[:q] = self._lower[self._own] / self._scale, self._upper[self._own] / self._scale
        memory: list[FloatArray] = []

        def residuals(z: FloatArray) -> FloatArray:
            return self._residuals(z, self.errors(z))

        def slopes(z: FloatArray) -> FloatArray:
            if shared is None and len(memory) % refresh == 0:
                memory.append(self.jacobian(z, upper))
            else:
                others = shared if shared is not None else memory[-1][:, q:]
                memory.append(np.column_stack([self.jacobian(z, upper, q), others]))
            return memory[-1]

        if len(z):
            z = least_squares(
                residuals, _inside(z, lower, upper), slopes, (lower, upper), loss=self._criterion,
                max_nfev=most, ftol=1e-4, xtol=1e-5,
            ).x  # fmt: skip
        return self.result(z, slopes(z) if len(z) else np.empty((0, 0)))

    def shared_slopes(self, fit: JointFit) -> FloatArray | None:
        """Derivatives by constants and initial states from another fit to the same records; None where states differ.

        Rows are those of the scaled errors and of the priors.
        """
        if len(fit.initial[0]) != len(self.model.states):
            return None
        slopes: FloatArray = fit.jacobian[:, len(fit.coefficients) :]
        return slopes

    def result(self, z: FloatArray, jacobian: FloatArray) -> JointFit:
        """What these unknowns amount to."""
        errors = self.errors(z)
        p = self._parameters(z)
        values = {q.name: float(v) for q, v in zip(self.model.parameters, p, strict=True)}
        states = tuple(self._first(i, z) for i in range(len(self.rows.records)))
        return JointFit(values, self.coefficients, z, jacobian, states, errors, self.cost(z, errors))

    def jacobian(self, z: FloatArray, upper: FloatArray, count: int | None = None) -> FloatArray:
        """Derivatives of residuals by the first `count` unknowns, all by default, as differences of runs."""
        q, c, nx = self._sizes
        p, last = self._parameters(z), self._last
        errors = last[1] if last is not None and np.array_equal(last[0], z) else self.errors(z)
        base = self._residuals(z, errors)
        columns = []
        for i in range(len(z) if count is None else count):
            step = np.zeros(len(z))
            step[i] = DIFFERENCE if z[i] + DIFFERENCE <= upper[i] else -DIFFERENCE
            if q <= i < q + c:
                step[i] /= self._reach[i - q]
            moved = list(errors)
            touched = range(len(errors)) if i < q + c else [(i - q - c) // nx]
            parameters = self._parameters(z + step) if i < q + c else p
            for k in touched:
                moved[k] = self._errors_of(k, parameters, z + step)
            columns.append((self._residuals(z + step, moved) - base) / step[i])
        return np.column_stack(columns) if columns else np.empty((len(base), 0))

    def _parameters(self, z: FloatArray) -> FloatArray:
        q, c, _ = self._sizes
        p = self.model.parameter_values
        p[self._own] = z[:q] * self._scale
        p[self._shared] = self.constants.mean + self.constants.root @ z[q : q + c]
        inside: FloatArray = np.clip(p, self._lower, self._upper)
        return inside

    def _first(self, which: int, z: FloatArray) -> FloatArray:
        q, c, nx = self._sizes
        shift = z[q + c + which * nx : q + c + (which + 1) * nx]
        first: FloatArray = self._initial[which] + self._state_scale * shift
        return first

    def _errors_of(self, which: int, p: FloatArray, z: FloatArray) -> FloatArray:
        record, columns = self.rows.records[which], list(self.rows.columns)
        with np.errstate(all="ignore"):
            run = self._simulator.outputs(record, self._first(which, z), p)
        errors: FloatArray = record.outputs[:, columns] - run[:, columns]
        return errors

    def _residuals(self, z: FloatArray, errors: Sequence[FloatArray]) -> FloatArray:
        parts = [self.rows.scaled(i, e).ravel() for i, e in enumerate(errors)]
        return np.concatenate([*parts, self.prior(z)])

    def _criterion(self, squares: Any, /, *, cost_only: bool | None = None) -> Any:
        """Criterion of each squared residual with its two derivatives (3, n): Student's t, and quadratic for priors."""
        del cost_only
        rho = np.vstack([squares, np.ones_like(squares), np.zeros_like(squares)])
        data = slice(0, len(squares) - len(self._weights()))
        z, tau = squares[data], self._memory
        rho[0, data] = TAIL / tau * np.log1p(z / TAIL)
        rho[1, data] = 1 / (tau * (1 + z / TAIL))
        rho[2, data] = -1 / (tau * TAIL * (1 + z / TAIL) ** 2)
        return rho

    def _weights(self) -> FloatArray:
        _, c, nx = self._sizes
        return np.concatenate([np.ones(c), np.full(nx * len(self.rows.records), 1 / STATE_PRIOR)])


def _inside(z: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Unknowns moved off their bounds, where a search could not start."""
    low = np.where(np.isfinite(lower), lower + EDGE * (1 + np.abs(np.nan_to_num(lower))), -np.inf)
    high = np.where(np.isfinite(upper), upper - EDGE * (1 + np.abs(np.nan_to_num(upper))), np.inf)
    moved: FloatArray = np.minimum(np.maximum(z, low), high)
    return moved
