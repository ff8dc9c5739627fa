"""Batch prediction-error method: fits any named parameters of a model, and its initial state, to a record.

Nonlinear least squares on the free-run error with exact sensitivities over the whole record (Ljung, *System
Identification*, 1999, chapter 7; Gauss-Newton in a trust region with bounds, `scipy.optimize.least_squares`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np

from adaptive_flot.contracts import Setup, Status
from adaptive_flot.contracts.batch import BatchFit, Identifiability, ParameterEstimate
from adaptive_flot.errors import DataError, ModelError, near_match
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from estimators.pem.free_runs import FreeRuns, InitialState
from estimators.pem.in_step import SearchesInStep, can_go_in_step
from estimators.pem.problem import Problem, Search
from estimators.pem.starts import scattered
from estimators.shared.colour import colour

SHORT_ROWS, SHORT_SHARE = 200, 4
"""Rows, at least, on which starts are screened, and of a long record one part of so many."""
FURTHER = 3
"""Screened starts that are searched on all rows."""
FIRST_STEPS, SECOND_STEPS = 10, 40
"""Simulations of each start on the first rows, and on all."""
HALF = 0.5
"""Belief below which an error is an outlier, and not asked for its colour."""
SAME = 2.0
"""Difference in minus two log-likelihood below which two searches have ended at the same fit."""


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
    starts
        Starts of the search: the model's own values, and scattered ones where the first search leaves more than noise.

    Raises
    ------
    ModelError
        Unknown option.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        initial_state: InitialState = "steady",
        free: Sequence[str] | None = None,
        starts: int = 1,
    ) -> None:
        if initial_state not in ("steady", "estimated", "given"):
            known = ["steady", "estimated", "given"]
            raise ModelError(f"pem: unknown initial_state {initial_state!r}; {near_match(initial_state, known)}")
        self.setup = setup
        self.starts = starts
        self._runs = FreeRuns(setup, initial_state, free)

    @np.errstate(all="ignore")  # a run that leaves all bounds is a status
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
        return self._fit(record, self._runs.problem(record), None)

    @np.errstate(all="ignore")
    def fit_many(self, records: Sequence[Dataset]) -> list[BatchFit | Exception]:
        """Fit several records, each as `fit` does (to 1e-9), or what went wrong with one.

        Records with the same times are searched in step where the model is machine code: a record is a lane. A fit does
        not depend, to the bit, on the other records.
        """
        if not records or not can_go_in_step(self._runs, records):
            return [_outcome(lambda record=record: self.fit(record)) for record in records]  # type: ignore[misc]
        made = self._in_step.problems(records)
        pairs = [(r, p) for r, p in zip(records, made, strict=True) if isinstance(p, Problem)]
        searches = iter(self._in_step.search([r for r, _ in pairs], [p for _, p in pairs]) if pairs else [])
        fits = list[BatchFit | Exception]()
        for record, problem in zip(records, made, strict=True):
            if isinstance(problem, Problem):
                search = next(searches)
                fits.append(_outcome(lambda r=record, p=problem, s=search: self._fit(r, p, s)))  # type: ignore[misc]
            else:
                fits.append(problem)
        return fits

    @cached_property
    def _in_step(self) -> SearchesInStep:
        # made when first asked for: compiling it takes seconds
        return SearchesInStep(self._runs)

    def _fit(self, record: Dataset, problem: Problem, first: Search | None) -> BatchFit:
        """The fit of a record; `first` is the search from the model's own values where that is done already."""
        measured = record.outputs[:, self._runs.columns]
        present = np.isfinite(measured)
        if present.sum() <= len(problem.centre):
            raise DataError(
                f"{record.name}: {int(present.sum())} measurements of {', '.join(self.setup.outputs)} for "
                f"{len(problem.centre)} unknowns; give a longer record or fit fewer parameters"
            )
        first = first or self._runs.search(record, problem, np.zeros(len(problem.centre)))
        searches = [first, *self._further(record, problem, first)]
        evaluations = sum(s.evaluations for s in searches)
        best = min(searches, key=lambda s: s.criterion)
        if not np.isfinite(best.criterion):
            return self._failed(record, problem)
        agreed = sum(s.criterion - best.criterion < SAME for s in searches)
        best, believed = self._runs.weighed(record, problem, best)
        fit = self._result(record, problem, best, believed, present, evaluations)
        fit = replace(fit, starts=len(searches), agreed=agreed)
        return fit if best.converged else replace(fit, status=Status.NOT_CONVERGED)

    def _further(self, record: Dataset, problem: Problem, first: Search) -> list[Search]:
        """Searches from other starts, where the first one leaves more than noise: successive halving.

        All starts take a few steps on the first rows of the record. The FURTHER that come furthest take SECOND_STEPS on
        all rows. Those that are better than the first search by then go on to the end.
        """
        if self.starts < 2 or not np.isfinite(first.criterion) or self._runs.leaves_noise_alone(record, problem, first):
            return []
        short = record.rows(0, min(len(record), max(SHORT_ROWS, len(record) // SHORT_SHARE)))
        measured = short.outputs[:, self._runs.columns]
        present = np.isfinite(measured)
        if present.sum() <= len(problem.centre):
            return []
        usual = np.maximum(first.noise, self._runs.first_noise(measured))
        screened = []
        for start in scattered(problem, self.starts - 1):
            solution = self._runs.solve(short, problem.anew(), start, usual, measured, present, FIRST_STEPS)
            if solution is not None:
                screened.append((float(solution.cost), cast(FloatArray, solution.x)))
        best = sorted(screened, key=lambda s: s[0])[:FURTHER]
        second = [self._runs.search(record, problem, z, SECOND_STEPS) for _, z in best]
        return [
            self._runs.search(record, problem, s.unknowns) if s.criterion < first.criterion - SAME else s
            for s in second
        ]

    # -- results ---------------------------------------------------------------------------------------------------

    def _result(
        self,
        record: Dataset,
        problem: Problem,
        best: Search,
        believed: FloatArray,
        present: FloatArray,
        evaluations: int,
    ) -> BatchFit:
        model, q, unknowns = self.setup.model, len(self.setup.parameters), best.unknowns
        each, outliers = best.noise / np.sqrt(believed), bool((believed < 1).any())
        scaled = _covariance(self._runs.rows(record, problem, unknowns, each, present))
        covariance = (scaled * np.outer(problem.scale, problem.scale))[:q, :q]
        by_unknowns = np.vstack([self._runs.gradients(record, problem, unknowns)[1], np.diag(problem.scale)[:q]])
        joint = by_unknowns @ scaled @ by_unknowns.T
        p, x0 = self._runs.start_of(record, problem, unknowns)
        values = problem.centre[:q] + problem.scale[:q] * unknowns[:q]
        errors = self._runs.errors(record, problem, unknowns, record.outputs[:, self._runs.columns])
        freedom = np.sqrt(present.sum() / (present.sum() - unknowns.size))
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
            noise_std=freedom * self._runs.noise(errors, np.ones_like(errors)) if outliers else best.noise,
            parameters=p,
            initial_state=x0,
            last_state=self._runs.last_state(record, problem, unknowns),
            evaluations=evaluations,
            status=Status.PROJECTED if at_bound.any() else Status.OK,
            identifiability=Identifiability.judge(
                [e.label for e in estimates], scaled[:q, :q], [e.at_bound for e in estimates]
            ),
            joint_covariance=(joint + joint.T) / 2,
            colour=colour(np.where(believed > HALF, errors, np.nan)),
            core_noise_std=best.noise if outliers else None,
        )

    def _failed(self, record: Dataset, problem: Problem) -> BatchFit:
        model, q = self.setup.model, len(self.setup.parameters)
        nan = float("nan")
        parameters = [model.parameters[i] for i in model.indices("parameters", self.setup.parameters)]
        return BatchFit(
            record=record.name,
            estimates=tuple(ParameterEstimate(p.name, p.label, p.unit, p.value, nan, False) for p in parameters),
            covariance=np.full((q, q), nan),
            noise_std=np.full(len(self._runs.columns), nan),
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


def _outcome(fit: Callable[[], BatchFit]) -> BatchFit | Exception:
    try:
        return fit()
    except Exception as error:
        return error


def _covariance(jacobian: FloatArray) -> FloatArray:
    """(J'J)^-1 by singular values; a direction that the data do not touch gets a huge variance, not a zero one."""
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    floor = max(float(s[0]), 1e-300) * 1e-12
    return cast(FloatArray, (vt.T / np.maximum(s, floor) ** 2) @ vt)
