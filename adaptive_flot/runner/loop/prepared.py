"""A scenario with all that its runs have in common: estimators and batch fit are built once, for every seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from adaptive_flot.contracts import AnyController, AnyEstimator, ControllerSetup, Setup
from adaptive_flot.contracts.batch import BatchEstimator
from adaptive_flot.contracts.delayed_measurements import taking_delayed_values
from adaptive_flot.described import Described
from adaptive_flot.errors import ScenarioError, located, near_match
from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.ensemble.steady_states import SteadyStates
from adaptive_flot.plugins import BATCH_ESTIMATORS, CONTROLLERS, ESTIMATORS, construct, load
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


@dataclass(frozen=True, repr=False)
class Prepared(Described):
    """A scenario and its plug-ins.

    An estimator is a frozen configuration (`Estimator`), so all seeds can share one. A controller is built for the
    schedule of its run.

    Attributes
    ----------
    scenario
        The scenario.
    estimators, controllers
        Plug-ins by the name under which they run.
    """

    scenario: Scenario
    estimators: Mapping[str, Plugin]
    controllers: Mapping[str, Plugin]
    _built: dict[str, AnyEstimator] = field(default_factory=dict, repr=False)

    def described(self) -> dict[str, object]:
        """What is prepared; see `Described`."""
        who = {"estimators": ", ".join(self.estimators), "controllers": ", ".join(self.controllers)}
        return {"scenario": self.scenario.name, **who}

    @classmethod
    def of(cls, scenario: Scenario, estimators: Sequence[str] = (), controllers: Sequence[str] = ()) -> Prepared:
        """The estimators and controllers named, default all of the scenario.

        Raises
        ------
        ScenarioError
            Unknown estimator or controller.
        """
        chosen = {name: estimator_plugin(scenario, name) for name in estimators} or dict(scenario.file.estimators)
        moved = {name: controller_plugin(scenario, name) for name in controllers} or dict(scenario.file.controllers)
        return cls(scenario, chosen, moved)

    def setup(self, name: str, realisation: Realisation) -> Setup:
        """What the estimator of a run is built for; one with `needs_truth` gets the truth, and the plant's model."""
        s = self.scenario
        if not self._needs_truth(name):
            return s.setup
        known = tuple(p for p in s.setup.parameters if p in s.plant_model.names("parameters"))
        return replace(s.setup, model=s.plant_model, parameters=known, truth=realisation.parameters)

    def shares_fit(self, name: str) -> bool:
        """Whether runs with this estimator see the same first part as all others: not where its model is another."""
        return self.scenario.plant_model is self.scenario.model or not self._needs_truth(name)

    def estimator(self, name: str, realisation: Realisation) -> AnyEstimator:
        """The estimator of that name for a run: one for all runs, but where it is shown the truth."""
        if self._needs_truth(name):
            return self.new_estimator(name, self.setup(name, realisation))
        if name not in self._built:
            self._built[name] = self.new_estimator(name, self.scenario.setup)
        return self._built[name]

    def new_estimator(self, name: str, setup: Setup) -> AnyEstimator:
        """A new estimator of that name for a setup."""
        made = self.estimators[name].make(setup, ESTIMATORS, "estimator", self.scenario.path.parent)
        return taking_delayed_values(made, self.scenario.longest_dead_time)

    def controller(self, name: str, realisation: Realisation, listens_to: Setup) -> AnyController:
        """A controller of that name for a run, with the model of the estimator that it listens to."""
        s = self.scenario
        setup = ControllerSetup(listens_to.model, s.dt, realisation.plan, listens_to.parameters, s.limits, s.prices)
        made: AnyController = self.controllers[name].make(setup, CONTROLLERS, "controller", s.path.parent)
        return made

    def _needs_truth(self, name: str) -> bool:
        return self.estimators[name].needs_truth(self.scenario.path.parent)

    @cached_property
    def plants(self) -> Ensemble:
        """The simulated plants of many runs side by side."""
        return Ensemble(self.scenario.plant_model, self.scenario.dt)

    @cached_property
    def steady_plants(self) -> SteadyStates:
        """Their steady states."""
        # with the same derivatives as a fit asks for, which then is the same machine code
        known = self.scenario.plant_model.names("parameters")
        return SteadyStates(self.scenario.plant_model, [p for p in self.scenario.setup.parameters if p in known])

    @cached_property
    def batch(self) -> BatchEstimator:
        """The batch fit that gives the initial estimate, from the scenario's guess."""
        part, s = self.scenario.file.initial_estimate, self.scenario
        guess = Setup(s.model.with_parameters(part.guess), s.dt, s.setup.parameters, s.setup.outputs)
        factory = load(part.method, BATCH_ESTIMATORS, "batch estimator", s.path.parent)
        made: BatchEstimator = construct(factory, part.method, "batch estimator", guess, **part.options)
        return made


def estimator_plugin(scenario: Scenario, name: str) -> Plugin:
    """Plug-in behind a name: of the scenario, a shipped one or `my_file:MyEstimator`.

    Raises
    ------
    ScenarioError
        None of these; the message holds the nearest name.
    """
    return _plugin(name, "estimator", scenario.file.estimators, ESTIMATORS)


def controller_plugin(scenario: Scenario, name: str) -> Plugin:
    """Plug-in behind a name: of the scenario, a shipped one or `my_file:MyController`.

    Raises
    ------
    ScenarioError
        None of these; the message holds the nearest name.
    """
    return _plugin(name, "controller", scenario.file.controllers, CONTROLLERS)


def check_named(scenario: Scenario, estimators: Sequence[str], controllers: Sequence[str]) -> None:
    """Check the names that options gave, so that a message blames the option and not the scenario's file.

    Raises
    ------
    ScenarioError, PluginError
        None of the scenario, no shipped one, and nothing that can be loaded.
    """
    folder = scenario.path.parent
    with located("--estimator"):
        for name in estimators:
            load(estimator_plugin(scenario, name).use, ESTIMATORS, "estimator", folder)
    with located("--controller"):
        for name in controllers:
            load(controller_plugin(scenario, name).use, CONTROLLERS, "controller", folder)


def _plugin(name: str, what: str, own: Mapping[str, Plugin], shipped: Mapping[str, str]) -> Plugin:
    if name in own:
        return own[name]
    if name in shipped or ":" in name:
        return Plugin(use=name)
    raise ScenarioError(f"unknown {what} {name!r}; {near_match(name, {*own, *shipped})}")
