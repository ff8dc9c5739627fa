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

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants, first_states
from adaptive_flot.discovery.hypotheses.joint.rows import TAIL, Rows
from adaptive_flot.discovery.hypotheses.joint.unknowns import JointUnknowns
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator

SAME_INTERVAL = 1e-6
"""Share by which sampling intervals of records may differ."""
MOST_EVALUATIONS = 15
MOST_TIMES, STILL_FALLS = 6, 1e-3
"""Fits one after the other from a far start, as long as the criterion falls by this share."""


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


def check_intervals(records: Sequence[Dataset]) -> None:
    """Refuse records of different sampling intervals, which differ by more than a millionth.

    Raises
    ------
    ModelError
        Two of them do.
    """
    first, *others = records
    for r in others:
        if abs(r.dt - first.dt) > SAME_INTERVAL * first.dt:
            step = float(f"{max(r.dt, first.dt):.3g}")
            raise ModelError(
                f"{r.name}: one row every {r.dt:g} s, and {first.name} has one every {first.dt:g} s; import both with "
                f"the same step, as 'grid: {{step: {step:g} s}}' in the map of tags"
            )


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
        check_intervals(rows.records)
        self.model, self.rows, self.constants, self.coefficients = model, rows, constants, tuple(coefficients)
        self._last: tuple[FloatArray, tuple[FloatArray, ...]] | None = None
        self._simulator = RecordSimulator(model, rows.records[0].dt)
        self.unknowns = JointUnknowns(
            model, constants, self.coefficients, tuple(initial) or first_states(model, rows.records)
        )
        each = np.broadcast_to(rows.memory, len(rows.columns))
        self._memory = np.concatenate([np.tile(each, len(r)) for r in rows.records])

    def on(self, rows: Rows) -> JointFitter:
        """The same fitter on other rows of the same records: the model's functions are not made again."""
        other = copy(self)
        other.rows, other._last = rows, None
        return other

    def prior(self, z: FloatArray) -> FloatArray:
        """Residuals of the priors of constants and initial states."""
        return self.unknowns.prior(z)

    @property
    def memory(self) -> FloatArray:
        """Rows that count as one, of each residual of the data."""
        return self._memory

    def extended(self, fit: JointFit, values: Mapping[str, float]) -> FloatArray:
        """Unknowns of another fit of the same constants and records, with coefficients of one's own before them."""
        z, u = self.unknowns.start(values), self.unknowns
        q, c, nx = u.q, u.c, u.nx
        theirs, count = len(fit.coefficients), len(fit.initial[0])
        z[q : q + c] = fit.unknowns[theirs : theirs + c]
        for i in range(len(self.rows.records)):
            block = fit.unknowns[theirs + c + i * count : theirs + c + (i + 1) * count]
            z[q + c + i * nx : q + c + i * nx + count] = block
        return z

    def errors(self, z: FloatArray) -> tuple[FloatArray, ...]:
        """Measured minus free run of each record (N, m)."""
        p = self.unknowns.parameters(z)
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
        u = self.unknowns
        memory: list[FloatArray] = []

        def residuals(z: FloatArray) -> FloatArray:
            return self._residuals(z, self.errors(z))

        def slopes(z: FloatArray) -> FloatArray:
            if shared is None and len(memory) % refresh == 0:
                memory.append(self.jacobian(z))
            else:
                others = shared if shared is not None else memory[-1][:, u.q :]
                memory.append(np.column_stack([self.jacobian(z, u.q), others]))
            return memory[-1]

        if len(z):
            z = least_squares(
                residuals, u.off_bounds(z), slopes, (u.lower, u.upper), loss=self._criterion,
                max_nfev=most, ftol=1e-4, xtol=1e-5,
            ).x  # fmt: skip
        return self.result(z, slopes(z) if len(z) else np.empty((0, 0)))

    def fit_coefficients(self, z: FloatArray, *, most: int = MOST_EVALUATIONS) -> JointFit:
        """Fit the coefficients alone; constants and initial states stay as they are.

        They are no unknowns of the search, then. With derivatives of nothing for them, a trust region asks each step to
        be as long as it allows (Moré 1978), and no step near the solution is ever short enough.
        """
        u = self.unknowns
        q, rest = u.q, z[u.q :]

        def residuals(c: FloatArray) -> FloatArray:
            whole = np.concatenate([c, rest])
            return self._residuals(whole, self.errors(whole))

        def slopes(c: FloatArray) -> FloatArray:
            return self.jacobian(np.concatenate([c, rest]), q)

        c = least_squares(
            residuals, u.off_bounds(z)[:q], slopes, (u.lower[:q], u.upper[:q]), loss=self._criterion,
            max_nfev=most, ftol=1e-4, xtol=1e-5,
        ).x  # fmt: skip
        return self.result(np.concatenate([c, rest]), np.empty((0, 0)))

    def fit_from_afar(self, z: FloatArray) -> JointFit:
        """Fit everything from a start that may be far off, and go on as long as the criterion falls.

        A record that does not start at rest begins many standard deviations away from its initial state. One fit of
        `MOST_EVALUATIONS` then ends on the way, and whatever is fitted on from there seems to explain the rest.
        """
        fit = self.fit(z)
        for _ in range(MOST_TIMES - 1):
            further = self.fit(fit.unknowns)
            falls = further.cost < (1 - STILL_FALLS) * fit.cost
            fit = further if further.cost < fit.cost else fit
            if not falls:
                break
        return fit

    def deviations(self, fit: JointFit) -> FloatArray:
        """Standard deviations of the coefficients of a fit (q,), with constants and initial states free beside them.

        Those of the normal equations (Gauss-Newton), with the derivatives J of scaled errors r and priors, and the
        weights w of the criterion::

            C = (J' diag(w) J)^-1    w = 1 / (tau (1 + r^2 / TAIL)) of an error, 1 of a prior
        """
        weights = self._criterion(self._residuals(fit.unknowns, fit.errors) ** 2)[1]
        normal = fit.jacobian.T @ (weights[:, None] * fit.jacobian)
        variances = np.diag(np.linalg.pinv(normal, hermitian=True))[: self.unknowns.q]
        found: FloatArray = np.sqrt(np.maximum(variances, 0.0)) * self.unknowns.scale
        return found

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
        p = self.unknowns.parameters(z)
        values = {q.name: float(v) for q, v in zip(self.model.parameters, p, strict=True)}
        states = tuple(self.unknowns.first(i, z) for i in range(len(self.rows.records)))
        return JointFit(values, self.coefficients, z, jacobian, states, errors, self.cost(z, errors))

    def jacobian(self, z: FloatArray, count: int | None = None) -> FloatArray:
        """Derivatives of residuals by the first `count` unknowns, all by default, as differences of runs."""
        u, last = self.unknowns, self._last
        p, shared = u.parameters(z), u.q + u.c
        errors = last[1] if last is not None and np.array_equal(last[0], z) else self.errors(z)
        base = self._residuals(z, errors)
        columns = []
        for i in range(len(z) if count is None else count):
            step = u.difference(i, z)
            moved = list(errors)
            touched = range(len(errors)) if i < shared else [(i - shared) // u.nx]
            parameters = u.parameters(z + step) if i < shared else p
            for k in touched:
                moved[k] = self._errors_of(k, parameters, z + step)
            columns.append((self._residuals(z + step, moved) - base) / step[i])
        return np.column_stack(columns) if columns else np.empty((len(base), 0))

    def _errors_of(self, which: int, p: FloatArray, z: FloatArray) -> FloatArray:
        record, columns = self.rows.records[which], list(self.rows.columns)
        with np.errstate(all="ignore"):
            run = self._simulator.outputs(record, self.unknowns.first(which, z), p)
        errors: FloatArray = record.outputs[:, columns] - run[:, columns]
        return errors

    def _residuals(self, z: FloatArray, errors: Sequence[FloatArray]) -> FloatArray:
        parts = [self.rows.scaled(i, e).ravel() for i, e in enumerate(errors)]
        return np.concatenate([*parts, self.prior(z)])

    def _criterion(self, squares: Any, /, *, cost_only: bool | None = None) -> Any:
        """Criterion of each squared residual with its two derivatives (3, n): Student's t, and quadratic for priors."""
        del cost_only
        rho = np.vstack([squares, np.ones_like(squares), np.zeros_like(squares)])
        data = slice(0, len(squares) - len(self.unknowns.weights()))
        z, tau = squares[data], self._memory
        rho[0, data] = TAIL / tau * np.log1p(z / TAIL)
        rho[1, data] = 1 / (tau * (1 + z / TAIL))
        rho[2, data] = -1 / (tau * TAIL * (1 + z / TAIL) ** 2)
        return rho
