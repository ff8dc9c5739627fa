"""The keys of a scenario file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr

from adaptive_flot.plugins import DEFAULT_ESTIMATOR, ESTIMATORS, construct, load
from adaptive_flot.processes.effect_entry import EffectEntry
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.scenario.discovery_options import DiscoveryOptions
from adaptive_flot.runner.scenario.faults import Fault
from adaptive_flot.runner.scenario.inputs.profiles import FeedWalk, InputProfile, ParameterProfile
from adaptive_flot.yaml_files.part import Part

LARGEST_SEED = 2**63 - 1
"""Seeds are a column of 64-bit integers in the table of runs."""
Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED)]


class Measurement(Part):
    """One measured output: noise in the output's unit, how often it is measured, and when the value is known."""

    noise_std: float = Field(ge=0)
    every_s: float | None = Field(default=None, gt=0)
    """Time between two measurements; default every sampling interval."""
    dead_time_s: float = Field(default=0.0, ge=0)
    """Time from taking a measurement to knowing it."""
    frozen_after_s: float | None = Field(default=None, gt=0)
    """A value that repeats itself to the bit for so long counts as missing; default it is believed."""


class DisturbancePart(Part):
    """What is known of an input or plant parameter that the controller does not choose.

    A measurement is averaged over the interval that ends at its sample, repeated every `every_s` (default every sample)
    and known `dead_time_s` later; `noise_std` is in the column's unit. Not measured, an input is taken for its first
    planned value and a parameter for its nominal one.
    """

    measured: bool = True
    noise_std: float = Field(default=0.0, ge=0)
    every_s: float | None = Field(default=None, gt=0)
    dead_time_s: float = Field(default=0.0, ge=0)


class PlantPart(Part):
    """In what the plant differs from the model, and how it is simulated.

    The integrator `fast` is the Runge-Kutta step, `accurate` is IDAS on the DAE.
    """

    integrator: Literal["fast", "accurate"] = "fast"
    cell: str | None = None
    """Cell file of the plant, instead of that of the model; default the plant has the constants of the model."""
    effects: list[EffectEntry] | None = None
    """All effects of the plant, instead of those of the model; default the plant has the effects of the model."""
    feed_walk: dict[str, FeedWalk] = Field(default_factory=dict)
    """Inputs (by column) and parameters of the plant that wander; what is known of them says `disturbances`."""


class Adapt(Part):
    """Adapted parameters and the outputs that drive the adaptation."""

    parameters: list[str] = Field(min_length=1)
    outputs: list[str] = Field(min_length=1)


class InitialEstimate(Part):
    """First estimate: batch fit of the record up to a time, from a guess that is not the truth."""

    method: str = "pem"
    until_s: float = Field(gt=0)
    guess: dict[str, float] = Field(default_factory=dict)
    options: dict[str, Any] = Field(default_factory=dict)


class Plugin(Part):
    """An estimator or controller: shipped name or `my_file:MyClass`, and its options."""

    use: str
    options: dict[str, Any] = Field(default_factory=dict)
    start: Literal["initial_estimate", "nominal"] = "initial_estimate"
    _factory: Callable[..., Any] | None = PrivateAttr(default=None)

    @classmethod
    def of(cls, factory: Callable[..., Any], options: Mapping[str, Any]) -> Plugin:
        """A class (or a function that makes one) given in Python, where a file would give an address."""
        plugin = cls(use=getattr(factory, "__name__", type(factory).__name__), options=dict(options))
        plugin._factory = factory
        return plugin

    def with_options(self, options: Mapping[str, Any]) -> Plugin:
        """The same plug-in with some of its options replaced, or further ones."""
        return self.model_copy(update={"options": {**self.options, **options}})

    def make(self, setup: object, shipped: Mapping[str, str], what: str, folder: Path | None = None) -> Any:
        """Construct it.

        Parameters
        ----------
        setup
            First argument of the constructor; the options follow.
        shipped, what, folder
            As for `adaptive_flot.plugins.load`.

        Raises
        ------
        PluginError
            It can not be loaded, or does not take the options.
        """
        return construct(self._load(shipped, what, folder), self.use, what, setup, **self.options)

    def needs_truth(self, folder: Path | None = None) -> bool:
        """Whether it is an estimator that is shown the true parameters: its class says `needs_truth = True`.

        Raises
        ------
        PluginError
            It can not be loaded.
        """
        return bool(getattr(self._load(ESTIMATORS, "estimator", folder), "needs_truth", False))

    def _load(self, shipped: Mapping[str, str], what: str, folder: Path | None) -> Callable[..., Any]:
        factory: Callable[..., Any] = self._factory or load(self.use, shipped, what, folder)
        return factory


class LimitsPart(Part):
    """Limits of the closed loop; columns carry the units."""

    concentrate_grade: float = Field(ge=0, le=1)
    level_m: tuple[float, float]
    inputs: dict[str, tuple[float, float]]
    largest_move: dict[str, Annotated[float, Field(gt=0)]]


class EconomicsPart(Part):
    """Prices in currency units: per kg of valuable mineral, per kg of concentrate, per m3 of air, per m3 of feed."""

    metal_per_kg: float = Prices().metal
    treatment_per_kg: float = Prices().treatment
    air_per_m3: float = Prices().air
    reagent_per_m3: float = Prices().reagent


class CaseEntry(Part):
    """One combination to run."""

    estimator: str
    controller: str


class Published(Part):
    """Published fits by estimator name, and their source, for the report."""

    source: str
    fits: dict[str, dict[str, float]]


class ScenarioFile(Part):
    """Keys of a scenario file."""

    description: str
    model: str = "flotation"
    """Model of estimators and controllers, and the plant's where `plant` says nothing else; a model file too."""
    cell: str | None = None
    effects: list[EffectEntry] = Field(default_factory=list)
    """Further effects of the model."""
    duration_s: float = Field(gt=0)
    sampling_s: float = Field(default=1.0, gt=0)
    seeds: list[Seed] = Field(default=[1], min_length=1)
    inputs: dict[str, InputProfile]
    parameters: dict[str, ParameterProfile] = Field(default_factory=dict)
    disturbances: dict[str, DisturbancePart] = Field(default_factory=dict)
    """What is known of inputs that are not moved (default: everything) and of parameters (default: nothing)."""
    measurements: dict[str, Measurement]
    initial_state: dict[str, float] = Field(default_factory=dict)
    """States that do not start steady, by column (`m_valuable_kg: 0`); known to the estimators too."""
    faults: list[Fault] = Field(default_factory=list)
    """What fails when; see `adaptive_flot.runner.scenario.faults`."""
    plant: PlantPart = PlantPart()
    adapt: Adapt
    initial_estimate: InitialEstimate
    estimators: dict[str, Plugin] = Field(
        default_factory=lambda: {DEFAULT_ESTIMATOR: Plugin(use=DEFAULT_ESTIMATOR)}, min_length=1
    )
    """Default that of `adaptive_flot.plugins.DEFAULT_ESTIMATOR` alone."""
    controllers: dict[str, Plugin] = Field(default_factory=lambda: {"schedule": Plugin(use="schedule")})
    cases: list[CaseEntry] = Field(default_factory=list)
    """Combinations of estimator and controller; default all."""
    discovery: DiscoveryOptions | None = None
    """Search for what the model lacks while the loop runs; default no search."""
    limits: LimitsPart | None = None
    economics: EconomicsPart | None = None
    fits_after_s: float | None = None
    """Fits are taken over later times; default from the end of the initial record on."""
    published: Published | None = None
