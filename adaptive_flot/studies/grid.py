"""The runs of a study, each named by what it is: a hash of all that its result depends on, and the seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from adaptive_flot.greybox.model import Model, Parameter, Quantity
from adaptive_flot.plugins import module_file
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.studies.study_file import Arm, Study

NOT_CONTENT = {"description", "seeds", "estimators", "controllers", "cases", "published", "model", "cell"}
"""Keys of a scenario on which no result of a run depends, or that enter through the plug-ins chosen."""


@dataclass(frozen=True)
class Combination:
    """One combination of a study, to be run for every seed.

    Attributes
    ----------
    scenario, controller, estimator
        Names.
    hashes
        Hash of what each of them is, by kind; together they make `key`.
    """

    scenario: str
    controller: str
    estimator: str
    hashes: Mapping[str, str]

    @cached_property
    def key(self) -> str:
        """Twelve hexadecimal digits over names and hashes."""
        return digest([self.scenario, self.controller, self.estimator, dict(self.hashes)])

    def run(self, seed: int) -> str:
        """Name of the run with a seed: `<key>-<seed>`."""
        return f"{self.key}-{seed}"


@dataclass(frozen=True)
class Grid:
    """All runs of a study: every case with every seed. `options` are those of the whole study."""

    cases: tuple[Combination, ...]
    seeds: tuple[int, ...]
    options: Mapping[str, Any]

    def runs(self) -> list[str]:
        """Names of the runs, seed by seed: the estimators of one seed share its initial fit."""
        return [case.run(seed) for seed in self.seeds for case in self.cases]


def grid_of(study: Study, *, compiled: bool = False) -> Grid:
    """Runs of a study. A compiled step agrees with the plain one to rounding only, so it makes other runs."""
    options = {"version": version("adaptive-flot"), "compiled": compiled}
    return Grid(tuple(c for arm in study.arms for c in cases_of(arm, options)), study.seeds, options)


def cases_of(arm: Arm, options: Mapping[str, Any]) -> list[Combination]:
    """Cases of one scenario of a study."""
    folder, common = arm.scenario.path.parent, {"scenario": scenario_hash(arm.scenario), "options": digest(options)}
    return [
        Combination(
            arm.scenario.name,
            controller,
            estimator,
            {
                **common,
                "controller": _plugin_hash(arm.controllers[controller], folder),
                "estimator": _plugin_hash(arm.estimators[estimator], folder),
            },
        )
        for controller, estimator in arm.combinations
    ]


def scenario_hash(scenario: Scenario) -> str:
    """Hash of plant, cell, inputs, drift, measurements and initial estimate; comments and layout do not count."""
    # what a model, a model file or a cell file comes to, is in the quantities and equations: their names do not count
    content = scenario.file.model_dump(mode="json", exclude=NOT_CONTENT, exclude_defaults=True, by_alias=True)
    model = scenario.model
    quantities = [_quantities(model), _quantities(scenario.plant_model)]
    functions = (model.dae, model.decay, scenario.plant_model.dae, scenario.plant_model.decay)
    equations = [hashlib.sha256(f.serialize().encode()).hexdigest() for f in functions]
    return digest([content, quantities, equations])


def _quantities(model: Model) -> list[dict[str, Any]]:
    named: tuple[Quantity | Parameter, ...] = (*model.states, *model.inputs, *model.parameters, *model.outputs)
    return [{k: v for k, v in asdict(q).items() if k not in ("source", "description")} for q in named]


def content_hash(scenario: Scenario, *plugins: Mapping[str, Plugin]) -> str:
    """Hash of a scenario with the plug-ins that run on it, a user's own code included."""
    folder = scenario.path.parent
    named = [{name: _plugin_hash(plugin, folder) for name, plugin in part.items()} for part in plugins]
    return digest([scenario_hash(scenario), *named])


def _plugin_hash(plugin: Plugin, folder: Path) -> str:
    code = _code(plugin.use, folder)
    # the file's content tells what it is, wherever it lies
    use = plugin.use if code is None else f"{Path(plugin.use.rpartition(':')[0]).stem}:{plugin.use.rpartition(':')[2]}"
    return digest([use, plugin.options, plugin.start, code])


def _code(address: str, folder: Path) -> str | None:
    """Hash of a user's own file; None for what is shipped or installed."""
    module, colon, _ = address.rpartition(":")
    file = module_file(module, folder) if colon else None
    return None if file is None else hashlib.sha256(file.read_bytes()).hexdigest()


def digest(content: Any) -> str:
    """Twelve hexadecimal digits over plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:12]
