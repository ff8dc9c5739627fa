"""A scenario: what its file says, with the model and the plant that it names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adaptive_flot.contracts import Limits, Setup
from adaptive_flot.described import Described
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.scenario.faults import ControllerFault, PlantFault, SlowAnalyser
from adaptive_flot.runner.scenario.inputs.profiles import FeedWalk, ParameterProfile
from adaptive_flot.runner.scenario.inputs.recorded import Recorded
from adaptive_flot.runner.scenario.keys import ScenarioFile


@dataclass(frozen=True, repr=False)
class Scenario(Described):
    """A validated scenario.

    Attributes
    ----------
    name
        Stem of its file.
    path
        The file.
    file
        Its content.
    model
        The nominal model: that of estimators and controllers, the oracle's apart.
    setup
        What estimators are built for.
    plant_model
        The plant's own model. It may have other constants, and other effects: then it has other states and parameters
        after those in common.
    """

    name: str
    path: Path
    file: ScenarioFile
    model: Model
    setup: Setup
    plant_model: Model

    def described(self) -> dict[str, object]:
        """What it runs; see `Described`."""
        file = self.file
        return {
            "name": self.name,
            "model": self.model.name,
            "duration": f"{file.duration_s:g} s every {self.dt:g} s",
            "adapts": ", ".join(file.adapt.parameters),
            "estimators": ", ".join(file.estimators),
            "controllers": ", ".join(file.controllers),
            "seeds": _few(file.seeds),
        }

    def compiled(self) -> Scenario:
        """The same scenario, its step and its estimators as machine code (`Model.compiled`)."""
        model = replace(self.model, compiled=True)
        plant = model if self.plant_model is self.model else replace(self.plant_model, compiled=True)
        return replace(self, model=model, setup=replace(self.setup, model=model), plant_model=plant)

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return self.file.sampling_s

    @property
    def recorded(self) -> dict[str, Recorded]:
        """Inputs that a record plays, by column."""
        return {key: profile for key, profile in self.file.inputs.items() if isinstance(profile, Recorded)}

    @property
    def starts(self) -> FloatArray:
        """Start of each sampling interval [s] (N,)."""
        return self.dt * np.arange(round(self.file.duration_s / self.dt), dtype=float)

    @property
    def fits_after(self) -> float:
        """Fits are taken over times after this one [s]."""
        given = self.file.fits_after_s
        return self.file.initial_estimate.until_s if given is None else given

    @property
    def initial_rows(self) -> int:
        """Number of intervals used for the initial estimate."""
        return round(self.file.initial_estimate.until_s / self.dt)

    @property
    def limits(self) -> Limits | None:
        """Limits of the closed loop by input name, None in open loop."""
        part = self.file.limits
        if part is None:
            return None
        names = {q.column: q.name for q in self.model.inputs}
        return Limits(
            outputs={"concentrate_grade": (part.concentrate_grade, np.inf)},
            inputs={names[column]: limits for column, limits in part.inputs.items()},
            moves={names[column]: move for column, move in part.largest_move.items()},
            states={"level": part.level_m},
        )

    @property
    def prices(self) -> Prices | None:
        """Prices, None where the scenario has no economics."""
        part = self.file.economics
        if part is None:
            return None
        return Prices(part.metal_per_kg, part.treatment_per_kg, part.air_per_m3, part.reagent_per_m3)

    def combinations(self, estimators: Sequence[str] = (), controllers: Sequence[str] = ()) -> list[tuple[str, str]]:
        """(controller, estimator) to run: the scenario's cases, or of these the ones with the names given.

        Where both are given, or the scenario has no cases, every controller runs with every estimator. An estimator in
        no case runs with the scenario's first controller, a controller in no case with every estimator.
        """
        file = self.file
        every, moved = list(estimators or file.estimators), list(controllers or file.controllers)
        if not file.cases or (estimators and controllers):
            return [(controller, name) for controller in moved for name in every]
        cases = [(c.controller, c.estimator) for c in file.cases]
        apart = [(moved[0], name) for name in estimators if name not in {e for _, e in cases}]
        apart += [(c, name) for c in controllers if c not in {known for known, _ in cases} for name in every]
        return [case for case in cases if case[0] in moved and case[1] in every] + apart

    @property
    def watched(self) -> tuple[str, ...]:
        """Names of the estimators that are watched for effects that their model lacks."""
        part = self.file.discovery
        if part is None:
            return ()
        named, folder = self.file.estimators.items(), self.path.parent
        return tuple(part.estimators or (name for name, plugin in named if not plugin.needs_truth(folder)))

    @property
    def imposed(self) -> list[int]:
        """Indices of the inputs that no controller moves: all but those with a range in `limits`.

        In open loop those that wander (`plant.feed_walk`).
        """
        inputs = enumerate(self.model.inputs)
        if self.limits is None:
            return [j for j, q in inputs if q.column in self.file.plant.feed_walk]
        return [j for j, q in inputs if q.name not in self.limits.inputs]

    @property
    def moving_parameters(self) -> list[tuple[str, ParameterProfile | FeedWalk]]:
        """Parameters of the plant that move, with how they do."""
        inputs = [q.column for q in self.model.inputs]
        walks = [(key, walk) for key, walk in self.file.plant.feed_walk.items() if key not in inputs]
        return [*self.file.parameters.items(), *walks]

    @property
    def measured_parameters(self) -> list[int]:
        """Indices of the parameters that are measured."""
        inputs = [q.column for q in self.model.inputs]
        parts = self.file.disturbances.items()
        return [self.model.index("parameters", key) for key, part in parts if key not in inputs and part.measured]

    @property
    def dead_times(self) -> dict[str, float]:
        """Dead time of each output that is known with a delay [s]."""
        return {name: m.dead_time_s for name, m in self.file.measurements.items() if m.dead_time_s > 0}

    @property
    def longest_dead_time(self) -> float:
        """Age of the oldest measurement that may still arrive [s], those of slow analysers (`faults`) included."""
        slow = [f.dead_time_s for f in self.file.faults if isinstance(f, SlowAnalyser)]
        return max([*self.dead_times.values(), *slow], default=0.0)

    @property
    def plant_faults(self) -> list[PlantFault]:
        """Faults of instruments and actuators, in the order of the file."""
        return [fault for fault in self.file.faults if not isinstance(fault, ControllerFault)]

    @property
    def controller_faults(self) -> list[ControllerFault]:
        """Faults inside the controller, in the order of the file."""
        return [fault for fault in self.file.faults if isinstance(fault, ControllerFault)]


def _few(seeds: Sequence[int]) -> str:
    """Seeds in words: the first ones where there are many."""
    return ", ".join(map(str, seeds)) if len(seeds) <= 5 else f"{seeds[0]}, {seeds[1]}, ... {len(seeds)} in all"
