"""Batch prediction-error method: fits any named parameters of a model, and its initial state, to a record.

Nonlinear least squares on the free-run error with exact sensitivities over the whole record (Ljung, *System
Identification*, 1999, chapter 7; Gauss-Newton in a trust region with bounds, `scipy.optimize.least_squares`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, cast

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from adaptive_flot.contracts import Setup, Status, full_parameters
from adaptive_flot.contracts.batch import BatchFit, Identifiability, ParameterEstimate
from adaptive_flot.errors import DataError, ModelError, RangeError, near_match
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady_state import steady_state, steady_state_gradient
from adaptive_flot.greybox.stepping.record import RecordSimulator

InitialState = Literal["steady", "estimated", "given"]
WEIGHT_PASSES = 5
"""Fits in turn, each weighted with the noise levels that the last one left, until these stand still."""
NOISE_CONVERGED = 0.01
MOST_EVALUATIONS = 1000
"""Simulations of the record in one search."""
KEPT_EVALUATIONS = 6
"""Start, outputs and derivatives at the last two points of a search."""

_T = TypeVar("_T")


@dataclass(frozen=True)
class _Problem:
    """Least squares in scaled unknowns: parameters, then the initial state where it is estimated."""

    centre: FloatArray
    scale: FloatArray
    lower: FloatArray
    upper: FloatArray
    prior_std: FloatArray
    steady: FloatArray
    seen: dict[tuple[str, bytes], Any] = field(default_factory=dict, repr=False)
    """What was evaluated last, by unknowns."""

    def once(self, what: str, unknowns: FloatArray, evaluate: Callable[[], _T]) -> _T:
        """Evaluate once for the same unknowns: each search starts, and is judged, where the one before ended."""
        key = (what, unknowns.tobytes())
        if key not in self.seen:
            value = evaluate()
            if len(self.seen) == KEPT_EVALUATIONS:
                del self.seen[next(iter(self.seen))]
            self.seen[key] = value
        return cast(_T, self.seen[key])


class Pem:
    """Batch fit of `setup.parameters` to `setup.outputs` of a record.

    Parameters
    ----------
    setup
        Model, sampling interval, the q parameters to fit and the m outputs to fit them to. A parameter's bounds, scale
        and prior standard deviation are those of the model.
    initial_state
        `steady`: the record starts at the steady state of its first inputs, which moves with the parameters;
        `estimated`: the state at the first row is fitted too, with a wide prior (its scale) around that steady state;
        `given`: the record carries it.
    free
        Names of states that are fitted with `initial_state="estimated"`; default all.

    Raises
    ------
    ModelError
        Unknown option.
    """

    def __init__(
        self, setup: Setup, *, initial_state: InitialState = "steady", free: Sequence[str] | None = None
    ) -> None:
        if initial_state not in ("steady", "estimated", "given"):
            known = ["steady", "estimated", "given"]
            raise ModelError(f"pem: unknown initial_state {initial_state!r}; {near_match(initial_state, known)}")
        self.setup = setup
        self.initial_state = initial_state
        self._columns = setup.model.indices("outputs", setup.outputs)
        self._simulator = RecordSimulator(setup.model, setup.dt)
        names = setup.model.names("states") if free is None else free
        self._free = setup.model.indices("states", names) if initial_state == "estimated" else []

    def fit(self, record: Dataset) -> BatchFit:
        """Fit the record; missing measurements drop out.

        Returns
        -------
        BatchFit
            Estimates with covariance, noise level, initial and last state, identifiability verdict and a status:
            `OK`, `PROJECTED` (a parameter ends on a bound), `NOT_CONVERGED` (the search ran out of evaluations) or
            `NOT_FINITE` (the model can not simulate the record).

        Raises
        ------
        DataError
            Fewer measurements than unknowns, or no initial state in the record where it should be given.
        """
        problem = self._problem(record)
        measured = record.outputs[:, self._columns]
        present = np.isfinite(measured)
        if present.sum() <= len(problem.centre):
            raise DataError(
                f"{record.name}: {int(present.sum())} measurements of {', '.join(self.setup.outputs)} for "
                f"{len(problem.centre)} unknowns; give a longer record or fit fewer parameters"
            )
        samples = int(present.sum())
        freedom = np.sqrt(samples / max(samples - len(problem.centre), 1))
        noise = self._first_noise(measured)
        unknowns = np.zeros(len(problem.centre))
        evaluations = 0
        for _ in range(WEIGHT_PASSES):
            solution = self._solve(record, problem, unknowns, noise, measured, present)
            if solution is None:
                return self._failed(record, problem)
            unknowns, used = cast(FloatArray, solution.x), noise
            evaluations += int(solution.nfev)
            noise = freedom * self._noise(self._errors(record, problem, unknowns, measured))
            converged = solution.status > 0
            if not converged or np.allclose(noise, used, rtol=NOISE_CONVERGED, atol=0):
                break
        fit = self._result(record, problem, unknowns, noise, present, evaluations)
        return fit if converged else replace(fit, status=Status.NOT_CONVERGED)

    # -- the least-squares problem ---------------------------------------------------------------------------------

    def _problem(self, record: Dataset) -> _Problem:
        model = self.setup.model
        parameters = [model.parameters[i] for i in model.indices("parameters", self.setup.parameters)]
        states = [model.states[i] for i in self._free]
        if self.initial_state == "given":
            if record.initial_state is None:
                raise DataError(f"{record.name}: the first row does not hold all states; use initial_state: estimated")
            start = record.initial_state
        else:
            start = self._start(record)
        centre = np.array([p.value for p in parameters] + [start[i] for i in self._free])
        scale = np.array([p.scale for p in parameters] + [q.scale for q in states])
        prior = np.array([p.prior_std or np.inf for p in parameters] + [q.scale for q in states]) / scale
        lower = (np.array([p.lower for p in parameters] + [q.lower for q in states]) - centre) / scale
        upper = (np.array([p.upper for p in parameters] + [q.upper for q in states]) - centre) / scale
        return _Problem(centre, scale, np.minimum(lower, -1e-9), np.maximum(upper, 1e-9), prior, start)

    def _start(self, record: Dataset) -> FloatArray:
        model = self.setup.model
        guess = np.array([model.initial_guess.get(q.name, q.scale) for q in model.states])
        if self.initial_state == "estimated" and not model.starts_steady:
            return guess
        return steady_state(model, record.inputs[0], time=float(record.time[0])).state

    def _steady(self, record: Dataset, p: FloatArray, guess: FloatArray) -> FloatArray:
        return steady_state(self.setup.model, record.inputs[0], p, guess, float(record.time[0])).state

    def _unpack(self, record: Dataset, problem: _Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameter vector (np,) and initial state (nx,)."""
        values = problem.centre + problem.scale * unknowns
        q = len(self.setup.parameters)
        p = full_parameters(self.setup.model, self.setup.parameters, values[:q])
        if self.initial_state == "steady":
            return p, self._steady(record, p, problem.steady)
        x0 = problem.steady.copy()
        x0[self._free] = values[q:]
        return p, x0

    def _rows(
        self, record: Dataset, problem: _Problem, unknowns: FloatArray, noise: FloatArray, present: FloatArray
    ) -> FloatArray:
        """Rows of the least-squares Jacobian: measurements over their noise, then priors."""
        rows = (-self._jacobian(record, problem, unknowns) / noise[:, None])[present]
        return np.vstack([rows, np.diag(1 / problem.prior_std)[np.isfinite(problem.prior_std)]])

    def _noise(self, errors: FloatArray) -> FloatArray:
        """Root mean square of each output's error (m,), kept off zero."""
        scale = np.array([self.setup.model.outputs[c].scale for c in self._columns])
        rms = np.array([np.sqrt(np.nanmean(e**2)) for e in errors.T])
        return cast(FloatArray, np.maximum(rms, 1e-12 * scale))

    def _errors(self, record: Dataset, problem: _Problem, unknowns: FloatArray, measured: FloatArray) -> FloatArray:
        def simulate() -> FloatArray:
            try:
                p, x0 = self._start_of(record, problem, unknowns)
            except RangeError:  # no steady state with these parameters: the search takes its step back
                return np.full_like(measured, np.nan)
            return self._simulator.outputs(record, x0, p)[:, self._columns]

        return measured - problem.once("outputs", unknowns, simulate)

    def _start_of(self, record: Dataset, problem: _Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        return problem.once("start", unknowns, lambda: self._unpack(record, problem, unknowns))

    def _jacobian(self, record: Dataset, problem: _Problem, unknowns: FloatArray) -> FloatArray:
        """d(prediction)/d(unknowns) (N, m, q + free)."""
        return self._gradients(record, problem, unknowns)[0]

    def _gradients(self, record: Dataset, problem: _Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives for the unknowns of the prediction (N, m, q + free) and of the last state (nx, q + free)."""
        return problem.once("gradients", unknowns, lambda: self._sensitivities(record, problem, unknowns))

    def _sensitivities(self, record: Dataset, problem: _Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        p, x0 = self._start_of(record, problem, unknowns)
        names, q = self.setup.parameters, len(self.setup.parameters)
        x0_gradient = np.zeros((x0.size, len(problem.centre)))
        if self.initial_state == "steady":
            x0_gradient[:, :q] = steady_state_gradient(
                self.setup.model, x0, record.inputs[0], p, names, float(record.time[0])
            )
        x0_gradient[self._free, q + np.arange(len(self._free))] = 1.0
        _, gradient, last = self._simulator.sensitivities(record, x0, p, names, x0_gradient)
        return gradient[:, self._columns, :] * problem.scale, last * problem.scale

    def _solve(
        self,
        record: Dataset,
        problem: _Problem,
        start: FloatArray,
        noise: FloatArray,
        measured: FloatArray,
        present: FloatArray,
    ) -> OptimizeResult | None:
        with_prior = np.isfinite(problem.prior_std)

        def residuals(unknowns: FloatArray) -> FloatArray:
            error = (self._errors(record, problem, unknowns, measured) / noise)[present]
            return np.concatenate([error, (unknowns / problem.prior_std)[with_prior]])

        def jacobian(unknowns: FloatArray) -> FloatArray:
            return self._rows(record, problem, unknowns, noise, present)

        if not np.isfinite(residuals(start)).all():
            return None
        inside = np.clip(start, problem.lower + 1e-9, problem.upper - 1e-9)
        return least_squares(
            residuals,
            inside,
            jacobian,
            bounds=(problem.lower, problem.upper),
            method="trf",
            xtol=1e-10,
            ftol=1e-10,
            max_nfev=MOST_EVALUATIONS,
        )

    def _first_noise(self, measured: FloatArray) -> FloatArray:
        # the noise of an output is at most what is left of it after differencing: a start that needs no model
        steps = np.diff(measured, axis=0)
        scale = np.array([self.setup.model.outputs[c].scale for c in self._columns])
        std = np.array([np.sqrt(np.mean(s[np.isfinite(s)] ** 2) / 2) if np.isfinite(s).any() else 0 for s in steps.T])
        return cast(FloatArray, np.maximum(std, 1e-6 * scale))

    # -- results ---------------------------------------------------------------------------------------------------

    def _result(
        self,
        record: Dataset,
        problem: _Problem,
        unknowns: FloatArray,
        noise: FloatArray,
        present: FloatArray,
        evaluations: int,
    ) -> BatchFit:
        model, q = self.setup.model, len(self.setup.parameters)
        scaled = _covariance(self._rows(record, problem, unknowns, noise, present))
        covariance = (scaled * np.outer(problem.scale, problem.scale))[:q, :q]
        by_unknowns = np.vstack([self._gradients(record, problem, unknowns)[1], np.diag(problem.scale)[:q]])
        joint = by_unknowns @ scaled @ by_unknowns.T
        p, x0 = self._start_of(record, problem, unknowns)
        values = problem.centre[:q] + problem.scale[:q] * unknowns[:q]
        at_bound = np.minimum(unknowns - problem.lower, problem.upper - unknowns)[:q] < 1e-6
        estimates = tuple(
            ParameterEstimate(name, model.parameters[i].label, model.parameters[i].unit, float(v), float(s), bool(b))
            for name, i, v, s, b in zip(
                self.setup.parameters,
                model.indices("parameters", self.setup.parameters),
                values,
                np.sqrt(np.diag(covariance)),
                at_bound,
                strict=True,
            )
        )
        return BatchFit(
            record=record.name,
            estimates=estimates,
            covariance=covariance,
            noise_std=noise,
            parameters=p,
            initial_state=x0,
            last_state=self._simulator.last_state(record, x0, p),
            evaluations=evaluations,
            status=Status.PROJECTED if at_bound.any() else Status.OK,
            identifiability=Identifiability.judge(
                [e.label for e in estimates], scaled[:q, :q], [e.at_bound for e in estimates]
            ),
            joint_covariance=(joint + joint.T) / 2,
        )

    def _failed(self, record: Dataset, problem: _Problem) -> BatchFit:
        model, q = self.setup.model, len(self.setup.parameters)
        nan = float("nan")
        parameters = [model.parameters[i] for i in model.indices("parameters", self.setup.parameters)]
        return BatchFit(
            record=record.name,
            estimates=tuple(ParameterEstimate(p.name, p.label, p.unit, p.value, nan, False) for p in parameters),
            covariance=np.full((q, q), nan),
            noise_std=np.full(len(self._columns), nan),
            parameters=model.parameter_values,
            initial_state=problem.steady,
            last_state=problem.steady,
            evaluations=0,
            status=Status.NOT_FINITE,
            identifiability=Identifiability(
                tuple((p.label, nan, "not fitted") for p in parameters),
                (),
                "the model can not simulate the record from its first guess",
            ),
        )


def _covariance(jacobian: FloatArray) -> FloatArray:
    """(J'J)^-1 by singular values; a direction that the data do not touch gets a huge variance, not a zero one."""
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    floor = max(float(s[0]), 1e-300) * 1e-12
    return cast(FloatArray, (vt.T / np.maximum(s, floor) ** 2) @ vt)
