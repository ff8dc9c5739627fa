"""Plants of many seeds at once, before any estimator: what acts on each, and what its instruments show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyController, Decision, DecisionTable, Setup, Status
from adaptive_flot.contracts.controller import decides_all
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.ensemble.steady_states import SteadyStates
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.loop.returned import checked_decision, checked_decisions
from adaptive_flot.runner.plants.scenario_plant import initial_state, with_given_states
from adaptive_flot.runner.plants.true_outputs import TrueOutputs
from adaptive_flot.runner.results.run_arrays import RunArrays
from adaptive_flot.runner.scenario.checks import check_realisation
from adaptive_flot.runner.scenario.realisation import Realisation


@dataclass(frozen=True)
class Member:
    """A run before its estimator: its place among the others, what acts and what is known of it by row."""

    place: int
    realisation: Realisation
    decisions: DecisionTable | Sequence[Decision]
    acting: FloatArray
    shown: FloatArray
    known: FloatArray | None

    @classmethod
    def of(cls, place: int, realisation: Realisation, controller: AnyController, setup: Setup) -> Member:
        """Decide for the whole run.

        Raises
        ------
        RangeError, ModelError
            An input or parameter of this seed leaves the model's range.
        """
        check_realisation(realisation)
        scenario = realisation.scenario
        decisions, inputs = _decided(controller, len(scenario.starts), len(setup.model.inputs))
        around = realisation.disturbances(setup.model)
        acting = np.where(np.isnan(around.inputs), inputs, around.inputs)
        shown = np.where(np.isnan(around.shown), inputs, around.shown)
        return cls(place, realisation, decisions, acting, shown, around.parameters)


def _decided(
    controller: AnyController, intervals: int, inputs: int
) -> tuple[DecisionTable | Sequence[Decision], FloatArray]:
    """What an open loop decides for a whole run, and the inputs (N, nu) of it."""
    if decides_all(controller):
        table = checked_decisions(controller, intervals, inputs)
        return table, table.inputs
    decisions, state = list[Decision](), controller.init(0.0)
    for _ in range(intervals):
        state, decision = checked_decision(controller, controller.decide(state, None, None), inputs)
        decisions.append(decision)
    return decisions, np.array([d.inputs for d in decisions])


@dataclass(frozen=True)
class Seen:
    """A run after its plant and before its estimator: time (N,), true and measured outputs (N, ny)."""

    member: Member
    time: FloatArray
    true: FloatArray
    measured: FloatArray

    def arrays(self, setup: Setup, rows: int, track: Track | None) -> RunArrays:
        """The run, with what the estimator made of the samples after the first rows; None: there are none."""
        m, n, q = self.member, len(self.time), len(setup.parameters)
        sizes = {"prediction": (len(setup.model.outputs),), "innovation_std": (len(setup.outputs),)}
        estimated = {
            name: np.full((n, *size), np.nan)
            for name, size in {**sizes, "parameters": (q,), "covariance": (q, q)}.items()
        }
        statuses = [Status.INITIALISING] * n
        if track is not None:
            for name, values in estimated.items():
                values[rows:] = getattr(track, name)
            statuses[rows:] = track.statuses
        return RunArrays(
            time=self.time,
            inputs=m.shown,
            acted=m.acting,
            true=self.true,
            measured=self.measured,
            parameters=m.realisation.parameters,
            known=m.known,
            prediction=estimated["prediction"],
            innovation=self.measured - estimated["prediction"],
            innovation_std=estimated["innovation_std"],
            estimates=estimated["parameters"],
            covariance=estimated["covariance"],
            statuses=statuses,
            **_columns(m.decisions, n),
        )


def _columns(decisions: DecisionTable | Sequence[Decision], n: int) -> dict[str, Any]:
    """What `RunArrays` tells of n decisions."""
    if isinstance(decisions, DecisionTable):
        return {
            "control_statuses": [decisions.status] * n,
            "decided_by": [decisions.decided_by] * n,
            "messages": (),
            "softened": (),
            "solve_seconds": np.full(n, np.nan),
            "plans": (),
            "faults": (),
        }
    return {
        "control_statuses": [d.status for d in decisions],
        "decided_by": [d.decided_by for d in decisions],
        "messages": [d.message for d in decisions],
        "softened": [d.softened for d in decisions],
        "solve_seconds": np.array([d.solve_seconds for d in decisions]),
        "plans": [d.plan for d in decisions],
        "faults": [d.faults for d in decisions],
    }


def starts(steady: SteadyStates, members: Sequence[Member]) -> list[FloatArray | Exception]:
    """State (nx,) in which each member's plant starts, or why there is none."""
    if not members:
        return []
    inputs = np.array([m.realisation.schedule[0] for m in members])
    states, good = steady.find(inputs, np.array([m.realisation.parameters[0] for m in members]))
    found = list[FloatArray | Exception]()
    for m, state, fine in zip(members, states, good, strict=True):
        r = m.realisation
        scenario, plant = r.scenario, r.scenario.plant_model
        try:
            alone = None if fine else initial_state(scenario, plant, r.schedule[0], r.parameters[0])
            found.append(with_given_states(scenario, plant, state) if alone is None else alone)
        except Exception as error:
            found.append(error)
    return found


def simulate_plants(plants: Ensemble, members: Sequence[Member], x0: Sequence[FloatArray]) -> list[Seen]:
    """What the plants of the members leave behind."""
    run = plants.simulate(
        np.array(x0),
        np.array([m.acting for m in members]),
        np.array([m.realisation.parameters for m in members]),
        keep=["states", "outputs"],
    )
    shown, seen = TrueOutputs(plants.model), []
    for k, m in enumerate(members):
        outputs = np.ascontiguousarray(run.outputs[k])
        true = shown.of_rows(outputs, run.time, run.states[k], m.acting, m.realisation.parameters)
        seen.append(Seen(m, run.time, true, outputs + m.realisation.measurement_noise))
    return seen
