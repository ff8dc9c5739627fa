"""The estimator of a link: over missing samples, longer gaps and restarts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyEstimator, Decision, Estimate, PlantRecord, Prior, Sample, Status
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.returned import checked_estimate
from adaptive_flot.runner.loop.starts import nominal_start, record_of


@dataclass(frozen=True)
class EstimationState:
    """What the next sample needs.

    Attributes
    ----------
    inner
        State of the estimator; None before it starts.
    estimate
        The newest estimate.
    began
        What it was started with; None before.
    collected
        Samples for the initial estimate, until it starts.
    last
        The newest sample.
    resumes
        Where to go on from: the last estimate that was stored; None to start anew.
    """

    inner: Any = None
    estimate: Estimate | None = None
    began: Prior | None = None
    collected: tuple[Sample, ...] = ()
    last: Sample | None = None
    resumes: Prior | None = None


class Estimation:
    """Gives an estimator the samples of a plant, one each interval.

    It starts as in a scenario: from the batch fit to the first part of the record. A restarted link starts from the
    last stored estimate instead.

    Parameters
    ----------
    prepared
        The scenario with its plug-ins.
    estimator
        The estimator, which takes delayed values where tags have delays.
    start
        `initial_estimate` or `nominal`, as in the scenario.
    longest_gap_s
        Intervals without sample up to so long are filled with missing measurements. After a longer gap the estimator
        starts again: its parameters from the last estimate, its state steady at the inputs of the new sample.
    """

    def __init__(self, prepared: Prepared, estimator: AnyEstimator, start: str, longest_gap_s: float) -> None:
        self.estimator, self._prepared, self._start = estimator, prepared, start
        self._dt = prepared.scenario.dt
        self._longest = max(1, round(longest_gap_s / self._dt))

    def take(self, state: EstimationState, sample: Sample) -> EstimationState:
        """Take a sample; one that is not newer than the last is left out."""
        last = state.last
        if last is not None:
            missed = round((sample.time - last.time) / self._dt) - 1
            if missed < 0:
                return state
            if missed > self._longest:
                state = self._restarted(state, sample)
            else:
                for k in range(missed):
                    state = self._next(state, missing(last, last.time + (k + 1) * self._dt))
        return replace(self._next(state, sample), last=sample)

    def _next(self, state: EstimationState, sample: Sample) -> EstimationState:
        if state.inner is None:
            state = self._begin(state, sample)
        if state.inner is None:
            return state
        inner, estimate = checked_estimate(self.estimator, self.estimator.update(state.inner, sample))
        return replace(state, inner=inner, estimate=estimate)

    def _begin(self, state: EstimationState, sample: Sample) -> EstimationState:
        if state.resumes is not None:
            prior = self._steady(state.resumes, sample)
            return replace(state, inner=self.estimator.init(prior), resumes=None, began=prior)
        collected = (*state.collected, sample)
        if len(collected) <= self._prepared.scenario.initial_rows:
            return replace(state, collected=collected)
        prior = self._initial(state.collected)
        return replace(state, inner=self.estimator.init(prior), collected=(), began=prior)

    def _initial(self, samples: Sequence[Sample]) -> Prior:
        scenario = self._prepared.scenario
        steps = [_as_step(sample) for sample in samples]
        fitted = self._prepared.batch.fit(record_of(scenario, scenario.setup, steps)).prior(samples[-1].time)
        if self._start == "initial_estimate":
            return fitted
        record = record_of(scenario, self.estimator.setup, steps)
        return nominal_start(scenario, self.estimator.setup, record, fitted)

    def _restarted(self, state: EstimationState, sample: Sample) -> EstimationState:
        if state.estimate is None or state.began is None:
            return EstimationState(resumes=state.resumes)
        prior = self._steady(state.began.at(state.estimate), sample)
        return replace(state, inner=self.estimator.init(prior))

    def _steady(self, prior: Prior, sample: Sample) -> Prior:
        """The prior one interval before a sample. After a gap the state is unknown: steady at the sample's inputs."""
        begin = sample.time - self._dt
        setup = self.estimator.setup
        full = setup.model.parameter_values
        full[setup.model.indices("parameters", setup.parameters)] = prior.parameters
        full[setup.model.indices("parameters", prior.disturbances)] = [v for v, _ in prior.disturbances.values()]
        return replace(prior, time=begin, state=steady_state(setup.model, sample.inputs, full).state)


def missing(before: Sample, time: float) -> Sample:
    """A sample that nobody has seen: inputs as before, no output."""
    return replace(before, time=time, outputs=np.full_like(before.outputs, np.nan), delayed=())


def _as_step(sample: Sample) -> Step:
    unknown = np.full(1, np.nan)
    return Step(Decision(sample.inputs, Status.OK, "plant"), PlantRecord(sample, unknown, unknown, sample.inputs), None)
