"""Scenario files: YAML, validated once into frozen objects. Behind this file nobody sees a dictionary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import ValidationError

from adaptive_flot.contracts import Limits, Setup
from adaptive_flot.errors import ScenarioError, located, near_match
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.processes.effect_entry import attach
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.processes.registry import make_model
from adaptive_flot.resources import scenario_folder
from adaptive_flot.runner.scenario.checks import check_scenario
from adaptive_flot.runner.scenario.faults import SlowAnalyser
from adaptive_flot.runner.scenario.keys import ScenarioFile
from adaptive_flot.yaml_problems import first_problem


@dataclass(frozen=True)
class Scenario:
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
        The plant's own model, which may have other effects and so other states and parameters after those in common.
    """

    name: str
    path: Path
    file: ScenarioFile
    model: Model
    setup: Setup
    plant_model: Model

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
        return tuple(part.estimators or (n for n, e in self.file.estimators.items() if e.use != "oracle"))

    def schedule(self, seed: int) -> FloatArray:
        """Planned inputs (N, nu) of a run."""
        columns = [self.file.inputs[q.column].values(self.starts, seed) for q in self.model.inputs]
        return np.column_stack(columns)

    def plan(self, seed: int) -> FloatArray:
        """Planned inputs (N, nu) as a controller may know them: disturbances keep their first value."""
        plan = self.schedule(seed)
        plan[:, self.imposed] = plan[0, self.imposed]
        return plan

    @property
    def imposed(self) -> list[int]:
        """Indices of the inputs that no controller moves: all but those with a range in `limits`; none in open loop."""
        if self.limits is None:
            return []
        return [j for j, q in enumerate(self.model.inputs) if q.name not in self.limits.inputs]

    @property
    def measured_parameters(self) -> list[int]:
        """Indices of the parameters that are measured."""
        inputs = [q.column for q in self.model.inputs]
        parts = self.file.disturbances.items()
        return [self.model.index("parameters", key) for key, part in parts if key not in inputs and part.measured]

    def true_parameters(self, seed: int) -> FloatArray:
        """Parameters of the plant's model (N, np) in each interval of a run."""
        p = np.tile(self.plant_model.parameter_values, (len(self.starts), 1))
        for name, change in self.file.parameters.items():
            column = self.plant_model.index("parameters", name)
            p[:, column] *= change.factor(self.starts, seed, self.plant_model.parameters[column].name)
        return p

    @property
    def dead_times(self) -> dict[str, float]:
        """Dead time of each output that is known with a delay [s]."""
        return {name: m.dead_time_s for name, m in self.file.measurements.items() if m.dead_time_s > 0}

    @property
    def longest_dead_time(self) -> float:
        """Age of the oldest measurement that may still arrive [s], those of slow analysers (`faults`) included."""
        slow = [f.dead_time_s for f in self.file.faults if isinstance(f, SlowAnalyser)]
        return max([*self.dead_times.values(), *slow], default=0.0)

    def measured_at(self) -> npt.NDArray[np.bool_]:
        """Whether each output is measured at the end of each interval (N, ny)."""
        ends = self.starts + self.dt
        measured = np.zeros((len(ends), len(self.model.outputs)), dtype=bool)
        for name, m in self.file.measurements.items():
            # the first sampling instant at or after each multiple of the period
            counted = np.floor(np.concatenate([[0.0], ends]) / (m.every_s or self.dt) + 1e-9)
            measured[:, self.model.index("outputs", name)] = np.diff(counted) > 0
        return measured

    def noise_std(self) -> FloatArray:
        """Noise of each output (ny,), NaN where it is not measured."""
        std = np.full(len(self.model.outputs), np.nan)
        for j, q in enumerate(self.model.outputs):
            if q.name in self.file.measurements:
                std[j] = self.file.measurements[q.name].noise_std
        return std


def shipped_scenarios() -> dict[str, Path]:
    """Shipped scenario files by name."""
    return {f.stem: f for f in sorted(scenario_folder().glob("*.yaml"))}


def find_scenario(name: str) -> Path:
    """Path of a scenario: a file, or the name of a shipped one.

    Raises
    ------
    ScenarioError
        Neither.
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = shipped_scenarios()
    if name in (path.stem, f"{path.stem}.yaml") and path.stem in shipped:
        return shipped[path.stem]
    raise ScenarioError(f"{name}: no such scenario file; shipped: {near_match(path.stem, shipped)}")


def load_scenario(name: Path | str) -> Scenario:
    """Read and check a scenario.

    Raises
    ------
    ScenarioError
        Unknown key (with the nearest one), wrong type, missing input, times that do not fit.
    CellError, ModelError, RangeError, PluginError
        The cell, a parameter name, an input value or the model is wrong.
    """
    path = find_scenario(str(name))
    try:
        content = yaml.safe_load(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not a YAML file ({' '.join(str(error).split())}); correct it") from error
    if not isinstance(content, dict):
        raise ScenarioError(f"{path}: holds no keys; see `adaptive-flot scenarios` for examples to copy")
    try:
        file = ScenarioFile.model_validate(content)
    except ValidationError as error:
        raise ScenarioError(f"{path}: {first_problem(error, ScenarioFile)}") from error
    with located(path):
        model = attach(make_model(file.model, cell=file.cell, folder=path.parent), file.effects)
        plant = model
        if file.plant.effects is not None:
            plant = attach(model.without_effects(), file.plant.effects, "plant.effects")
        scenario = Scenario(path.stem, path, file, model, _setup(file, model), plant)
        check_scenario(scenario)
    return scenario


def _setup(file: ScenarioFile, model: Model) -> Setup:
    parameters = model.expand_parameters(file.adapt.parameters)
    outputs = tuple(model.outputs[i].name for i in model.indices("outputs", file.adapt.outputs))
    unmeasured = [o for o in outputs if o not in file.measurements]
    if unmeasured:
        raise ScenarioError(f"adapt.outputs: {unmeasured[0]!r} is not among the measurements; add it there")
    return Setup(model, file.sampling_s, parameters, outputs)
