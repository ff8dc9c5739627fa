"""Study files: scenarios x estimators x controllers x seeds, validated once into a frozen object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from adaptive_flot.errors import StudyError, located, near_match
from adaptive_flot.plugins import module_file
from adaptive_flot.resources import scenario_folder
from adaptive_flot.runner.loop.prepared import controller_plugin, estimator_plugin
from adaptive_flot.runner.scenario.keys import LARGEST_SEED, Plugin, Seed
from adaptive_flot.runner.scenario.loading import find_scenario, load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.yaml_files.part import Part
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import read_yaml

MOST_SEEDS = 1_000_000
"""Largest study: its list of runs still fits into memory."""


class Seeds(Part):
    """`{first: 1, count: 1000}`, or a plain list of numbers."""

    first: Seed = 1
    count: int | None = Field(default=None, ge=1, le=MOST_SEEDS)
    listed: list[Seed] | None = Field(default=None, min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _plain_list(cls, value: Any) -> Any:
        return {"listed": value} if isinstance(value, list) else value

    @model_validator(mode="after")
    def _one_way(self) -> Seeds:
        if (self.count is None) == (self.listed is None):
            raise ValueError("give a list of seeds, or first and count")
        if self.count is not None and self.first > LARGEST_SEED - self.count + 1:
            raise ValueError(f"the last seed is above the largest, {LARGEST_SEED}; give a smaller first")
        return self

    def values(self) -> tuple[int, ...]:
        """The seeds, each once."""
        numbers = self.listed if self.listed is not None else range(self.first, self.first + (self.count or 0))
        return tuple(dict.fromkeys(numbers))


def _names_alone(value: Any) -> Any:
    return dict.fromkeys(value) if isinstance(value, list) and all(isinstance(v, str) for v in value) else value


Plugins = Annotated[dict[str, Plugin | None], BeforeValidator(_names_alone)]
"""A list of names, or names with `use` and `options`; a name alone stands for the one of the scenario."""


class StudyFile(Part):
    """Keys of a study file."""

    description: str
    scenarios: list[str] = Field(min_length=1)
    estimators: Plugins = Field(default_factory=dict)
    """Default all of each scenario."""
    controllers: Plugins = Field(default_factory=dict)
    """Default all of each scenario."""
    seeds: Seeds


@dataclass(frozen=True)
class Arm:
    """One scenario of a study with the plug-ins that run on it, and (controller, estimator) of its combinations."""

    scenario: Scenario
    estimators: Mapping[str, Plugin]
    controllers: Mapping[str, Plugin]
    combinations: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Study:
    """A validated study; its runs are every combination of every arm with every seed."""

    name: str
    path: Path
    description: str
    arms: tuple[Arm, ...]
    seeds: tuple[int, ...]


def shipped_studies() -> dict[str, Path]:
    """Shipped study files by name."""
    return {f.stem: f for f in sorted((scenario_folder() / "studies").glob("*.yaml"))}


def load_study(name: Path | str) -> Study:
    """Read and check a study: a file, or the name of a shipped one.

    Raises
    ------
    StudyError
        No such file, unknown key (with the nearest one), wrong type, nothing to run.
    AdaptiveFlotError
        A scenario, estimator or controller of it is wrong.
    """
    path = _find(str(name))
    content = read_yaml(path, StudyError, "holds no keys; give description, scenarios and seeds")
    try:
        file = StudyFile.model_validate(content)
    except ValidationError as error:
        raise StudyError(f"{path}: {first_problem(error, StudyFile)}") from error
    with located(path):
        folder = path.resolve().parent
        arms = tuple(_arm(file, _scenario(entry, folder), folder) for entry in dict.fromkeys(file.scenarios))
        names = [arm.scenario.name for arm in arms]
        if len(set(names)) < len(names):
            raise StudyError(f"scenarios: two of them have the same name ({', '.join(names)}); rename one file")
    return Study(path.stem, path, file.description, arms, file.seeds.values())


def _find(name: str) -> Path:
    path = Path(name)
    if path.is_file():
        return path
    shipped = shipped_studies()
    if name in (path.stem, f"{path.stem}.yaml") and path.stem in shipped:
        return shipped[path.stem]
    raise StudyError(f"{name}: no such study file; {near_match(path.stem, shipped, 'shipped')}")


def _scenario(name: str, folder: Path) -> Scenario:
    """A scenario beside the study file, relative to here, or a shipped one."""
    beside = folder / name
    return load_scenario(beside if beside.is_file() else find_scenario(name).resolve())


def _arm(file: StudyFile, scenario: Scenario, folder: Path) -> Arm:
    combinations = scenario.combinations(list(file.estimators), list(file.controllers))
    if not combinations:
        names = ", ".join(file.estimators)
        raise StudyError(f"estimators: none of {names} is in a case of {scenario.path}; give controllers too")
    chosen = {name: plugin or estimator_plugin(scenario, name) for name, plugin in file.estimators.items()}
    moved = {name: plugin or controller_plugin(scenario, name) for name, plugin in file.controllers.items()}
    chosen, moved = chosen or dict(scenario.file.estimators), moved or dict(scenario.file.controllers)
    places = folder, scenario.path.parent
    return Arm(scenario, _found(chosen, *places), _found(moved, *places), tuple(combinations))


def _found(plugins: Mapping[str, Plugin], *folders: Path) -> dict[str, Plugin]:
    """Plug-ins with a user's own file by its full path: a worker may run in another folder."""
    resolved = {}
    for name, plugin in plugins.items():
        module, colon, attribute = plugin.use.rpartition(":")
        file = module_file(module, *folders) if colon else None
        resolved[name] = plugin if file is None else plugin.model_copy(update={"use": f"{file}:{attribute}"})
    return resolved
