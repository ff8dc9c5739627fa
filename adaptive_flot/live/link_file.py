"""A link file: which scenario, which server, which tags, and what may be written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from adaptive_flot.errors import DataError, LinkError, located, near_match
from adaptive_flot.greybox.quantities import Parameter, Quantity
from adaptive_flot.live.link_keys import (
    MODES,
    CyclePart,
    HandshakePart,
    LiveTag,
    PagePart,
    Part,
    Scale,
    ServerPart,
    ShadowPart,
    WritePart,
)
from adaptive_flot.live.map_tags import with_map
from adaptive_flot.live.safety.modes import ModeRules
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario, shipped_scenarios
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import read_yaml

ShadowName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
TRIED = "extended"
"""Role of an extended model that runs in shadow; no key of `shadows` may be called so."""


class LinkFile(Part):
    """Keys of a link file."""

    scenario: str
    """Scenario file, or shipped name: model, estimators, controllers, limits, prices; never its plant."""
    estimator: str = DEFAULT_ESTIMATOR
    """One of the scenario's; the default one also where the scenario does not have it, then with its own defaults."""
    controller: str
    highest_mode: Literal["monitor", "advisory", "closed"] = "advisory"
    database: str = "sqlite:///live.sqlite"
    server: ServerPart
    map: str | None = None
    """Map of an import (YAML): gives the tags that `tags` does not, and the keys of a tag that it leaves out."""
    tags: dict[str, LiveTag] = Field(default_factory=dict)
    writes: dict[str, WritePart]
    handshake: HandshakePart
    cycle: CyclePart = CyclePart()
    page: PagePart | None = None
    shadows: dict[ShadowName, ShadowPart] = Field(default_factory=dict, max_length=4)
    """What runs beside the acting estimator and controller, by a name of its own."""
    extend: Literal["by a person", "by itself"] = "by a person"
    """Who applies an extension of the model that discovery found and that has run in shadow."""

    @property
    def mode_rules(self) -> ModeRules:
        """How patient the state machine is."""
        return ModeRules(MODES[self.highest_mode], self.cycle.shed_after, self.cycle.handshake_cycles)


class Link(BaseModel):
    """A link file with the scenario that it names."""

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)

    path: Path
    file: LinkFile
    scenario: Scenario

    def beside(self, name: str) -> Path:
        """A file named in the link file: beside it where the path is relative."""
        return self.path.parent / name


def tagged_quantities(scenario: Scenario) -> dict[str, Quantity | Parameter]:
    """What may have a tag, by name: inputs, outputs, and measured parameters as `parameter.<full name>`."""
    model = scenario.model
    found: dict[str, Quantity | Parameter] = {q.name: q for q in (*model.inputs, *model.outputs)}
    return found | {f"parameter.{model.parameters[i].name}": model.parameters[i] for i in scenario.measured_parameters}


def load_link(path: Path) -> Link:
    """Read and check a link file.

    Raises
    ------
    LinkError
        Unknown key, wrong type, a quantity without tag or that the model does not have, a unit that is not the model's,
        clamps outside the scenario's limits.
    ScenarioError
        The scenario can not be used.
    """
    content = read_yaml(path, LinkError, "holds no keys; write one with `adaptive-flot serve-plant --write-link`")
    try:
        file = LinkFile.model_validate(with_map(content, path))
    except ValidationError as error:
        raise LinkError(f"{path}: {first_problem(error, LinkFile)}") from error
    beside = path.parent / file.scenario
    with located(f"{path}: scenario"):
        scenario = load_scenario(file.scenario if file.scenario in shipped_scenarios() else beside)
    if file.estimator == DEFAULT_ESTIMATOR:
        scenario = _with_default_estimator(scenario)
    _check(path, file, scenario)
    return Link(path=path, file=file, scenario=scenario)


def _with_default_estimator(scenario: Scenario) -> Scenario:
    known = {DEFAULT_ESTIMATOR: Plugin(use=DEFAULT_ESTIMATOR), **scenario.file.estimators}
    return replace(scenario, file=scenario.file.model_copy(update={"estimators": known}))


def _check(path: Path, file: LinkFile, scenario: Scenario) -> None:
    model, limits = scenario.model, scenario.limits
    known = tagged_quantities(scenario)
    for name, tag in file.tags.items():
        if name not in known:
            raise LinkError(f"{path}: tags: the model has no {name!r}; {near_match(name, known)}")
        try:
            Scale.of(tag.unit, known[name].unit)
        except DataError as error:
            raise LinkError(f"{path}: tags.{name}: {error}") from error
    for name in (*model.names("inputs"), *scenario.setup.outputs):
        if name not in file.tags:
            raise LinkError(f"{path}: tags: {name!r} has no tag; the estimator needs one")
    if limits is None:
        raise LinkError(f"{path}: scenario {scenario.name!r} has no limits; a controller needs them")
    if set(file.writes) != set(limits.inputs):
        raise LinkError(f"{path}: writes: give one for each of {', '.join(limits.inputs)}, and for no other input")
    for name, write in file.writes.items():
        try:
            Scale.of(write.unit, known[name].unit)
        except DataError as error:
            raise LinkError(f"{path}: writes.{name}: {error}") from error
        low, high = limits.inputs[name]
        if write.low < low or write.high > high:
            raise LinkError(
                f"{path}: writes.{name}: clamps [{write.low:g}, {write.high:g}] are wider than the scenario's "
                f"limits [{low:g}, {high:g}]; narrow them"
            )
    if TRIED in file.shadows:
        raise LinkError(f"{path}: shadows: {TRIED!r} is the name of an extended model in shadow; take another one")
    for name, shadow in file.shadows.items():
        _check_who(f"{path}: shadows.{name}", scenario, shadow.estimator, shadow.controller)
    _check_who(str(path), scenario, file.estimator, file.controller)


def _check_who(where: str, scenario: Scenario, estimator: str, controller: str | None) -> None:
    of_scenario = {"estimator": scenario.file.estimators, "controller": scenario.file.controllers}
    for what, name in (("estimator", estimator), ("controller", controller)):
        if name is not None and name not in of_scenario[what]:
            hint = near_match(name, of_scenario[what])
            raise LinkError(f"{where}: scenario {scenario.name!r} has no {what} {name!r}; {hint}")
    if scenario.file.estimators[estimator].needs_truth(scenario.path.parent):
        raise LinkError(f"{where}: estimator {estimator!r} needs the true parameters, which no plant tells")
