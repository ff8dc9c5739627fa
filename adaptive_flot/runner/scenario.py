"""Scenario files: YAML, validated once into frozen objects. Behind this file nobody sees a dictionary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from adaptive_flot.economics import Prices
from adaptive_flot.errors import ScenarioError, located, near_match
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.processes.registry import make_model
from adaptive_flot.protocols import Limits, Setup
from adaptive_flot.resources import scenario_folder
from adaptive_flot.runner.profiles import InputProfile, ParameterProfile
from adaptive_flot.runner.yaml_problems import first_problem

MOST_INTERVALS = 1e7
"""Longest run: its table still fits into memory."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Measurement(_Part):
    """One measured output: noise in the output's unit, how often it is measured, and when the value is known."""

    noise_std: float = Field(ge=0)
    every_s: float | None = Field(default=None, gt=0)
    """Time between two measurements; default every sampling interval."""
    dead_time_s: float = Field(default=0.0, ge=0)
    """Time from taking a measurement to knowing it."""


class DisturbancePart(_Part):
    """What is known of an input or plant parameter that the controller does not choose.

    A measurement is averaged over the interval that ends at its sample, repeated every `every_s` (default every sample)
    and known `dead_time_s` later; `noise_std` is in the column's unit. Not measured, an input is taken for its first
    planned value and a parameter for its nominal one.
    """

    measured: bool = True
    noise_std: float = Field(default=0.0, ge=0)
    every_s: float | None = Field(default=None, gt=0)
    dead_time_s: float = Field(default=0.0, ge=0)


class PlantPart(_Part):
    """How the plant is simulated: `fast` is the Runge-Kutta step, `accurate` IDAS on the DAE."""

    integrator: Literal["fast", "accurate"] = "fast"


class Adapt(_Part):
    """Adapted parameters and the outputs that drive the adaptation."""

    parameters: list[str] = Field(min_length=1)
    outputs: list[str] = Field(min_length=1)


class InitialEstimate(_Part):
    """First estimate: batch fit of the record up to a time, from a guess that is not the truth."""

    method: str = "pem"
    until_s: float = Field(gt=0)
    guess: dict[str, float] = Field(default_factory=dict)
    options: dict[str, Any] = Field(default_factory=dict)


class Plugin(_Part):
    """An estimator or controller: shipped name or `my_file:MyClass`, and its options."""

    use: str
    options: dict[str, Any] = Field(default_factory=dict)
    start: Literal["initial_estimate", "nominal"] = "initial_estimate"


class LimitsPart(_Part):
    """Limits of the closed loop; columns carry the units."""

    concentrate_grade: float = Field(ge=0, le=1)
    level_m: tuple[float, float]
    inputs: dict[str, tuple[float, float]]
    largest_move: dict[str, Annotated[float, Field(gt=0)]]


class EconomicsPart(_Part):
    """Prices in currency units: per kg of valuable mineral, per kg of concentrate, per m3 of air, per m3 of feed."""

    metal_per_kg: float = Prices().metal
    treatment_per_kg: float = Prices().treatment
    air_per_m3: float = Prices().air
    reagent_per_m3: float = Prices().reagent


class Case(_Part):
    """One combination to run."""

    estimator: str
    controller: str


class Published(_Part):
    """Published fits by estimator name, and their source, for the report."""

    source: str
    fits: dict[str, dict[str, float]]


class ScenarioFile(_Part):
    """Keys of a scenario file."""

    description: str
    model: str = "flotation"
    cell: str | None = None
    duration_s: float = Field(gt=0)
    sampling_s: float = Field(default=1.0, gt=0)
    seeds: list[Annotated[int, Field(ge=0)]] = Field(default=[1], min_length=1)
    inputs: dict[str, InputProfile]
    parameters: dict[str, ParameterProfile] = Field(default_factory=dict)
    disturbances: dict[str, DisturbancePart] = Field(default_factory=dict)
    """What is known of inputs that are not moved (default: everything) and of parameters (default: nothing)."""
    measurements: dict[str, Measurement]
    plant: PlantPart = PlantPart()
    adapt: Adapt
    initial_estimate: InitialEstimate
    estimators: dict[str, Plugin] = Field(min_length=1)
    controllers: dict[str, Plugin] = Field(default_factory=lambda: {"schedule": Plugin(use="schedule")})
    cases: list[Case] = Field(default_factory=list)
    """Combinations of estimator and controller; default all."""
    limits: LimitsPart | None = None
    economics: EconomicsPart | None = None
    fits_after_s: float | None = None
    """Fits are taken over later times; default from the end of the initial record on."""
    published: Published | None = None


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
        The nominal model.
    setup
        What estimators are built for.
    """

    name: str
    path: Path
    file: ScenarioFile
    model: Model
    setup: Setup

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
            part.concentrate_grade,
            part.level_m,
            {names[column]: limits for column, limits in part.inputs.items()},
            {names[column]: move for column, move in part.largest_move.items()},
        )

    @property
    def prices(self) -> Prices | None:
        """Prices, None where the scenario has no economics."""
        part = self.file.economics
        if part is None:
            return None
        return Prices(part.metal_per_kg, part.treatment_per_kg, part.air_per_m3, part.reagent_per_m3)

    def combinations(self, estimators: Sequence[str]) -> list[tuple[str, str]]:
        """(controller, estimator) to run: the cases of the scenario, or every controller with every estimator."""
        if self.file.cases:
            return [(c.controller, c.estimator) for c in self.file.cases if c.estimator in estimators]
        return [(controller, name) for controller in self.file.controllers for name in estimators]

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

    def true_parameters(self) -> FloatArray:
        """Plant parameters (N, np) in each interval."""
        p = np.tile(self.model.parameter_values, (len(self.starts), 1))
        for name, change in self.file.parameters.items():
            p[:, self.model.index("parameters", name)] *= change.factor(self.starts)
        return p

    @property
    def dead_times(self) -> dict[str, float]:
        """Dead time of each output that is known late [s]."""
        return {name: m.dead_time_s for name, m in self.file.measurements.items() if m.dead_time_s > 0}

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
        model = make_model(file.model, cell=file.cell, folder=path.parent)
        scenario = Scenario(path.stem, path, file, model, _setup(file, model))
        _check(scenario)
    return scenario


def _setup(file: ScenarioFile, model: Model) -> Setup:
    parameters = model.expand_parameters(file.adapt.parameters)
    outputs = tuple(model.outputs[i].name for i in model.indices("outputs", file.adapt.outputs))
    unmeasured = [o for o in outputs if o not in file.measurements]
    if unmeasured:
        raise ScenarioError(f"adapt.outputs: {unmeasured[0]!r} is not among the measurements; add it there")
    return Setup(model, file.sampling_s, parameters, outputs)


def _check(scenario: Scenario) -> None:
    """Check what one key alone does not show: times, names of the model, ranges."""
    _check_times(scenario)
    file, model = scenario.file, scenario.model
    columns = [q.column for q in model.inputs]
    for key in file.inputs:
        if key not in columns:
            raise ScenarioError(f"inputs: unknown input {key!r}; {near_match(key, columns)}")
    for column in columns:
        if column not in file.inputs:
            raise ScenarioError(f"inputs: {column!r} is missing; give its profile")
    model.indices("outputs", file.measurements)
    with located("initial_estimate.guess"):
        model.with_parameters(file.initial_estimate.guess)
    with located("parameters"):
        for name in file.parameters:
            values = scenario.true_parameters()[:, model.index("parameters", name)]
            for extreme in (values.min(), values.max()):
                model.with_parameters({name: float(extreme)})
    _check_closed_loop(scenario)
    _check_disturbances(scenario)
    for seed in file.seeds:
        model.check_inputs(scenario.schedule(seed), scenario.starts, where="inputs")


def _check_closed_loop(scenario: Scenario) -> None:
    file = scenario.file
    columns = [q.column for q in scenario.model.inputs]
    if file.limits is not None:
        for key in (*file.limits.inputs, *file.limits.largest_move):
            if key not in columns:
                raise ScenarioError(f"limits: unknown input {key!r}; {near_match(key, columns)}")
        for key, (low, high) in [("level_m", file.limits.level_m), *file.limits.inputs.items()]:
            if not low < high:
                raise ScenarioError(f"limits: {key} = [{low:g}, {high:g}]; give the lower value first")
    for case in file.cases:
        for name, known in ((case.estimator, file.estimators), (case.controller, file.controllers)):
            if name not in known:
                raise ScenarioError(f"cases: {name!r} is not defined; {near_match(name, known)}")


def _check_disturbances(scenario: Scenario) -> None:
    model = scenario.model
    imposed = [model.inputs[j].column for j in scenario.imposed]
    for key in scenario.file.disturbances:
        if key in (q.column for q in model.inputs):
            if key not in imposed:
                raise ScenarioError(f"disturbances: {key!r} is not one; name an input without a range in 'limits'")
        elif key not in (name for p in model.parameters for name in (p.name, p.symbol)):
            known = (*imposed, *model.names("parameters"))
            raise ScenarioError(f"disturbances: unknown input or parameter {key!r}; {near_match(key, known)}")
        elif model.parameters[model.index("parameters", key)].name in scenario.setup.parameters:
            raise ScenarioError(f"disturbances: {key!r} is adapted, so it can not be measured too; leave one out")


def _check_times(scenario: Scenario) -> None:
    file = scenario.file
    intervals = file.duration_s / file.sampling_s
    if not 2 <= intervals <= MOST_INTERVALS or abs(intervals - round(intervals)) > 1e-9:
        raise ScenarioError(
            f"duration_s = {file.duration_s:g} must be a whole number (2 to {MOST_INTERVALS:g}) of sampling_s intervals"
        )
    if not 2 <= scenario.initial_rows < round(intervals):
        raise ScenarioError(
            f"initial_estimate.until_s = {file.initial_estimate.until_s:g} s must hold 2 intervals or more and lie "
            f"before the end, {file.duration_s:g} s; correct it"
        )
    if not file.initial_estimate.until_s <= scenario.fits_after < file.duration_s:
        raise ScenarioError(
            f"fits_after_s = {scenario.fits_after:g} must lie between initial_estimate.until_s "
            f"({file.initial_estimate.until_s:g} s) and the end ({file.duration_s:g} s); correct it"
        )
