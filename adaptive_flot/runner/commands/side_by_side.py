"""Runs of many seeds at once: plants and estimators in lanes, where nothing that is decided depends on an estimate.

In an open loop the inputs are known beforehand. So the plants of all seeds are simulated first, and the estimator then
tracks all their records. Each run is the same, to the bit, whatever others are beside it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import AnyController, Decision, Estimate, PlantRecord, Sample, Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.contracts.ensemble_record import EnsembleRecord, tracks_ensembles
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.ensemble.ensemble import EnsembleRun
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.commands.run_result import Run
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.returned import checked_decision
from adaptive_flot.runner.loop.starts import prior_of, record_of
from adaptive_flot.runner.plants.scenario_plant import initial_state
from adaptive_flot.runner.plants.true_outputs import TrueOutputs
from adaptive_flot.runner.scenario.checks import check_realisation
from adaptive_flot.runner.scenario.realisation import Realisation

Fits = dict[str, BatchFit]


def can_go_side_by_side(prepared: Prepared, estimator: str, controller: str, first: Realisation) -> bool:
    """Whether runs of a combination may go side by side; `first` is any realisation of the scenario.

    The scenario runs as machine code, with the fast step, without faults, dead times or a watch. The controller is an
    open loop, and the estimator tracks ensembles and is not shown the truth.
    """
    scenario = prepared.scenario
    plain = not (
        scenario.file.faults
        or scenario.dead_times
        or scenario.file.plant.integrator == "accurate"
        or any(m.frozen_after_s is not None for m in scenario.file.measurements.values())
        or (scenario.file.discovery is not None and estimator in scenario.watched)
    )
    if not (scenario.model.compiled and plain and prepared.shares_fit(estimator)):
        return False
    setup = prepared.setup(estimator, first)
    if setup.truth is not None or not tracks_ensembles(prepared.estimator(estimator, first)):
        return False
    # of the class itself: one that is derived from it may well look at the estimate
    return bool(vars(type(prepared.controller(controller, first, setup))).get("open_loop", False))


def run_side_by_side(
    prepared: Prepared,
    estimator_name: str,
    controller_name: str,
    realisations: Sequence[Realisation],
    initial: Sequence[Fits],
) -> list[Run | Exception]:
    """Runs of a combination with several seeds, or what went wrong with one.

    Parameters
    ----------
    prepared, estimator_name, controller_name
        The combination; see `can_go_side_by_side`.
    realisations
        Of each seed.
    initial
        For each seed the batch fit under "fit" where it is known; it receives it where not.
    """
    begin = time.perf_counter()
    setup = prepared.scenario.setup
    found: dict[int, Run | Exception] = {}
    members: list[_Member] = []
    for i, realisation in enumerate(realisations):
        try:
            controller = prepared.controller(controller_name, realisation, setup)
            members.append(_Member.of(i, realisation, controller, setup))
        except Exception as error:
            found[i] = error
    if members:
        run = prepared.plants.simulate(
            np.array([m.x0 for m in members]),
            np.array([m.acting for m in members]),
            np.array([m.realisation.parameters for m in members]),
            keep=["states", "outputs"],
        )
        shown = TrueOutputs(prepared.scenario.plant_model)
        members = [replace(m, steps=_plant_steps(m, run, k, shown)) for k, m in enumerate(members)]
        found |= _estimated(prepared, estimator_name, controller_name, members, initial)
    each = round((time.perf_counter() - begin) / len(realisations), 4)
    results = (found[i] for i in range(len(realisations)))
    return [replace(r, seconds=each) if isinstance(r, Run) else r for r in results]


@dataclass(frozen=True)
class _Member:
    """A run before its estimator: its place among the others, its start, what acts and what is known of it by row."""

    place: int
    realisation: Realisation
    decisions: tuple[Decision, ...]
    x0: FloatArray
    acting: FloatArray
    shown: FloatArray
    known: FloatArray | None
    steps: tuple[Step, ...] = ()

    @classmethod
    def of(cls, place: int, realisation: Realisation, controller: AnyController, setup: Setup) -> _Member:
        """Decide for the whole run.

        Raises
        ------
        RangeError, ModelError
            An input or parameter of this seed, or its steady state, leaves the model's range.
        """
        check_realisation(realisation)
        scenario = realisation.scenario
        decisions, state = [], controller.init(0.0)
        for _ in range(len(scenario.starts)):
            returned = controller.decide(state, None, None)
            state, decision = checked_decision(controller, returned, len(setup.model.inputs))
            decisions.append(decision)
        inputs = np.array([d.inputs for d in decisions])
        around = realisation.disturbances(setup.model)
        x0 = initial_state(scenario, scenario.plant_model, realisation.schedule[0], realisation.parameters[0])
        acting = np.where(np.isnan(around.inputs), inputs, around.inputs)
        shown = np.where(np.isnan(around.shown), inputs, around.shown)
        return cls(place, realisation, tuple(decisions), x0, acting, shown, around.parameters)


def _plant_steps(member: _Member, run: EnsembleRun, place: int, shown: TrueOutputs) -> tuple[Step, ...]:
    """What the plant of a run left behind, without estimates."""
    outputs, states = run.outputs[place].copy(), run.states[place].copy()
    measured = outputs + member.realisation.measurement_noise
    p, known = member.realisation.parameters, member.known
    steps = []
    for k, (now, decision) in enumerate(zip(run.time.tolist(), member.decisions, strict=True)):
        sample = Sample(now, member.shown[k], measured[k], (), None if known is None else known[k])
        true = shown(outputs[k], now, states[k], member.acting[k], p[k])
        steps.append(Step(decision, PlantRecord(sample, true, p[k], member.acting[k]), None))
    return tuple(steps)


def _estimated(
    prepared: Prepared, estimator_name: str, controller_name: str, members: Sequence[_Member], initial: Sequence[Fits]
) -> dict[int, Run | Exception]:
    """Runs by place: an initial fit each, one tracking for all."""
    scenario, rows = prepared.scenario, prepared.scenario.initial_rows
    found: dict[int, Run | Exception] = {}
    estimator = prepared.estimator(estimator_name, members[0].realisation)
    started, states = list[_Member](), []
    for member in members:
        try:
            before = list(member.steps[:rows])
            fitted = initial[member.place]
            if "fit" not in fitted:
                fitted["fit"] = prepared.batch.fit(record_of(scenario, scenario.setup, before))
            states.append(estimator.init(prior_of(prepared, estimator_name, scenario.setup, before, fitted["fit"])))
            started.append(member)
        except Exception as error:
            found[member.place] = error
    if not started or rows >= len(scenario.starts):
        tracks: list[Track | None] = [None] * len(started)
    else:
        assert tracks_ensembles(estimator)
        tracks = [track for _, track in estimator.track_ensemble(states, _record(started, rows))]
    for member, track in zip(started, tracks, strict=True):
        fit = initial[member.place]["fit"]
        try:
            steps = _with_estimates(member.steps, rows, track)
            found[member.place] = Run.of(
                estimator_name, controller_name, member.realisation, steps, scenario.setup, fit
            )
        except Exception as error:
            found[member.place] = error
    return found


def _record(members: Sequence[_Member], rows: int) -> EnsembleRecord:
    """What the estimator sees of all members after the first rows."""
    time_s = np.array([s.plant.sample.time for s in members[0].steps[rows:]])
    outputs = np.array([[s.plant.sample.outputs for s in m.steps[rows:]] for m in members])
    known = None if members[0].known is None else np.array([m.known for m in members])[:, rows:]
    return EnsembleRecord(time_s, np.array([m.shown[rows:] for m in members]), outputs, known)


def _with_estimates(steps: Sequence[Step], rows: int, track: Track | None) -> list[Step]:
    if track is None:
        return list(steps)
    done = list(steps[:rows])
    for k, step in enumerate(steps[rows:]):
        sample, prediction = step.plant.sample, track.prediction[k]
        estimate = Estimate(
            sample.time,
            prediction,
            sample.outputs - prediction,
            track.innovation_std[k],
            track.parameters[k],
            track.covariance[k],
            track.state[k],
            track.statuses[k],
        )
        done.append(Step(step.decision, step.plant, estimate))
    return done
