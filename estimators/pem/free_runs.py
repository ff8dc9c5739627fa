"""Searches of a batch fit: free-run errors over a record, their derivatives, and least squares on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, cast

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from adaptive_flot.contracts import Setup, full_parameters
from adaptive_flot.errors import DataError, RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.ensemble.one_member import OneMember
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state, steady_state_gradient
from adaptive_flot.greybox.stepping.record import RecordSimulator
from estimators.pem.problem import Problem, Search
from estimators.shared.outliers import belief

InitialState = Literal["steady", "estimated", "given"]
WEIGHT_PASSES = 5
"""Fits in turn, each weighted with the noise levels that the last one left, until these stand still."""
NOISE_CONVERGED = 0.01
BELIEF_PASSES, BELIEF_CONVERGED = 5, 0.05
"""Fits in turn with outliers, each weighted by the beliefs that the last one left, until these stand still."""
MOST_EVALUATIONS = 1000
"""Simulations of the record in one search."""
AT_NOISE = 1.5
"""An error of so many times the noise from row to row is the noise: another start could not do better."""


class FreeRuns:
    """Free-run errors of the measured outputs, and searches for the unknowns that make them small.

    Parameters
    ----------
    setup
        Model, sampling interval, the q parameters to fit and the m outputs to fit them to.
    initial_state
        Where a run starts, see `Pem`.
    free
        Names of states that are fitted with `initial_state="estimated"`; default all.
    """

    def __init__(self, setup: Setup, initial_state: InitialState, free: Sequence[str] | None) -> None:
        self.setup, self.initial_state = setup, initial_state
        self.columns = setup.model.indices("outputs", setup.outputs)
        quick = OneMember.where_compiled(setup.model, setup.dt)
        self.simulator = RecordSimulator(setup.model, setup.dt, stepper=quick)
        names = setup.model.names("states") if free is None else free
        self.free = setup.model.indices("states", names) if initial_state == "estimated" else []
        self.starts_steady = initial_state == "steady" or (initial_state == "estimated" and setup.model.starts_steady)
        self.least_noise = 1e-12 * np.array([setup.model.outputs[c].scale for c in self.columns])

    def search(
        self,
        record: Dataset,
        problem: Problem,
        start: FloatArray,
        most: int | None = None,
        belief: FloatArray | None = None,
    ) -> Search:
        """The search from one start (unknowns,), weighted anew until the noise levels stand still.

        Each measurement counts by the `belief` in it (N, m), default 1.
        """
        measured = record.outputs[:, self.columns]
        present = np.isfinite(measured)
        weight = np.ones_like(measured) if belief is None else belief
        samples = float(weight[present].sum())
        freedom = np.sqrt(samples / max(samples - len(problem.centre), 1))
        noise, unknowns, evaluations, converged = self.first_noise(measured), start, 0, False
        for _ in range(WEIGHT_PASSES):
            each = noise if belief is None else noise / np.sqrt(weight)
            solution = self.solve(record, problem, unknowns, each, measured, present, most)
            if solution is None:
                return Search(unknowns, noise, evaluations, False, float("inf"))
            unknowns, used = cast(FloatArray, solution.x), noise
            evaluations += int(solution.nfev)
            noise = freedom * self.noise(self.errors(record, problem, unknowns, measured), weight)
            converged = bool(solution.status > 0)
            if not converged or np.allclose(noise, used, rtol=NOISE_CONVERGED, atol=0):
                break
        prior = np.sum((unknowns / problem.prior_std) ** 2)
        return Search(unknowns, noise, evaluations, converged, float(2 * present.sum(axis=0) @ np.log(noise) + prior))

    def weighed(self, record: Dataset, problem: Problem, search: Search) -> tuple[Search, FloatArray]:
        """The search again, each measurement weighted by the belief in it (N, m), until these beliefs stand still.

        Without outliers the search itself; see `estimators/shared/outliers.py`.
        """
        measured = record.outputs[:, self.columns]
        believed = belief(self.errors(record, problem, search.unknowns, measured))
        for _ in range(BELIEF_PASSES):
            if (believed == 1).all():
                break
            search = self.search(record, problem, search.unknowns, belief=believed)
            before, believed = believed, belief(self.errors(record, problem, search.unknowns, measured))
            if np.allclose(believed, before, atol=BELIEF_CONVERGED):
                break
        return search, believed

    def leaves_noise_alone(self, record: Dataset, problem: Problem, search: Search) -> bool:
        """Whether a search ended at the level of the noise, so that no other start could do better."""
        measured = record.outputs[:, self.columns]
        errors = self.errors(record, problem, search.unknowns, measured)
        quiet = 1.4826 * np.nanmedian(np.abs(np.diff(errors, axis=0)), axis=0) / np.sqrt(2)
        return bool(np.all(self.noise(errors, np.ones_like(errors)) < AT_NOISE * quiet))

    def problem(self, record: Dataset, steady: FloatArray | None = None) -> Problem:
        """Centre, scale and range of what is unknown of a record, whose steady start (nx,) may be known.

        Raises
        ------
        DataError
            No initial state in the record where it should be given.
        """
        model = self.setup.model
        parameters = [model.parameters[i] for i in model.indices("parameters", self.setup.parameters)]
        states = [model.states[i] for i in self.free]
        if self.initial_state == "given":
            if record.initial_state is None:
                raise DataError(f"{record.name}: the first row does not hold all states; use initial_state: estimated")
            start = record.initial_state
        else:
            start = self._start(record) if steady is None else steady
        centre = np.array([p.value for p in parameters] + [start[i] for i in self.free])
        scale = np.array([p.scale for p in parameters] + [q.scale for q in states])
        prior = np.array([p.prior_std or np.inf for p in parameters] + [q.scale for q in states]) / scale
        lower = (np.array([p.lower for p in parameters] + [q.lower for q in states]) - centre) / scale
        upper = (np.array([p.upper for p in parameters] + [q.upper for q in states]) - centre) / scale
        return Problem(centre, scale, np.minimum(lower, -1e-9), np.maximum(upper, 1e-9), prior, start)

    def _start(self, record: Dataset) -> FloatArray:
        model = self.setup.model
        guess = np.array([model.initial_guess.get(q.name, q.scale) for q in model.states])
        if not self.starts_steady:
            return guess
        return steady_state(model, record.inputs[0], time=float(record.time[0])).state

    def _steady(self, record: Dataset, p: FloatArray, guess: FloatArray) -> FloatArray:
        return steady_state(self.setup.model, record.inputs[0], p, guess, float(record.time[0])).state

    def _unpack(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameter vector (np,) and initial state (nx,)."""
        values = problem.centre + problem.scale * unknowns
        q = len(self.setup.parameters)
        p = full_parameters(self.setup.model, self.setup.parameters, values[:q])
        if self.initial_state == "steady":
            return p, self._steady(record, p, problem.steady)
        x0 = problem.steady.copy()
        x0[self.free] = values[q:]
        return p, x0

    def rows(
        self, record: Dataset, problem: Problem, unknowns: FloatArray, noise: FloatArray, present: FloatArray
    ) -> FloatArray:
        """Rows of the least-squares Jacobian: measurements over their noise, (m,) or (N, m), then priors."""
        rows = (-self._jacobian(record, problem, unknowns) / noise[..., None])[present]
        return np.vstack([rows, np.diag(1 / problem.prior_std)[np.isfinite(problem.prior_std)]])

    def noise(self, errors: FloatArray, weight: FloatArray) -> FloatArray:
        """Root mean square of each output's weighted errors (m,), kept off zero."""
        pairs = zip(errors.T, weight.T, strict=True)
        rms = np.array([np.sqrt(np.nansum(w * e**2) / w[np.isfinite(e)].sum()) for e, w in pairs])
        return cast(FloatArray, np.maximum(rms, self.least_noise))

    def errors(self, record: Dataset, problem: Problem, unknowns: FloatArray, measured: FloatArray) -> FloatArray:
        """Measured (N, m) less the free run from some unknowns; NaN where the model has no such run."""

        def simulate() -> FloatArray:
            try:
                p, x0 = self.start_of(record, problem, unknowns)
            except RangeError:  # no steady state with these parameters: the search takes its step back
                return np.full_like(measured, np.nan)
            return self.simulator.outputs(record, x0, p)[:, self.columns]

        return measured - problem.once("outputs", unknowns, simulate)

    def start_of(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameter vector (np,) and initial state (nx,) of some unknowns."""
        return problem.once("start", unknowns, lambda: self._unpack(record, problem, unknowns))

    def last_state(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> FloatArray:
        """State (nx,) at the last row of the free run from some unknowns."""
        p, x0 = self.start_of(record, problem, unknowns)
        return problem.once("last state", unknowns, lambda: self.simulator.last_state(record, x0, p))

    def _jacobian(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> FloatArray:
        """d(prediction)/d(unknowns) (N, m, q + free)."""
        return self.gradients(record, problem, unknowns)[0]

    def gradients(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives for the unknowns of the prediction (N, m, q + free) and of the last state (nx, q + free)."""
        return problem.once("gradients", unknowns, lambda: self._sensitivities(record, problem, unknowns))

    def _sensitivities(self, record: Dataset, problem: Problem, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        p, x0 = self.start_of(record, problem, unknowns)
        names, q = self.setup.parameters, len(self.setup.parameters)
        x0_gradient = np.zeros((x0.size, len(problem.centre)))
        if self.initial_state == "steady":
            x0_gradient[:, :q] = steady_state_gradient(
                self.setup.model, x0, record.inputs[0], p, names, float(record.time[0])
            )
        x0_gradient[self.free, q + np.arange(len(self.free))] = 1.0
        _, gradient, last = self.simulator.sensitivities(record, x0, p, names, x0_gradient)
        return gradient[:, self.columns, :] * problem.scale, last * problem.scale

    def solve(
        self,
        record: Dataset,
        problem: Problem,
        start: FloatArray,
        noise: FloatArray,
        measured: FloatArray,
        present: FloatArray,
        most: int | None,
    ) -> OptimizeResult | None:
        """Least squares from a start at fixed noise (m,) or (N, m), in `most` runs; None without a finite one."""
        with_prior = np.isfinite(problem.prior_std)

        def residuals(unknowns: FloatArray) -> FloatArray:
            error = (self.errors(record, problem, unknowns, measured) / noise)[present]
            return np.concatenate([error, (unknowns / problem.prior_std)[with_prior]])

        def jacobian(unknowns: FloatArray) -> FloatArray:
            return self.rows(record, problem, unknowns, noise, present)

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
            max_nfev=most or MOST_EVALUATIONS,
        )

    def first_noise(self, measured: FloatArray) -> FloatArray:
        """Upper limit (m,) of the noise of series (N, m): what differencing leaves, which needs no model."""
        steps = np.diff(measured, axis=0)
        scale = np.array([self.setup.model.outputs[c].scale for c in self.columns])
        std = np.array([np.sqrt(np.mean(s[np.isfinite(s)] ** 2) / 2) if np.isfinite(s).any() else 0 for s in steps.T])
        return cast(FloatArray, np.maximum(std, 1e-6 * scale))
