"""Read scenario files: YAML, validated once into frozen objects. Behind this file nobody sees a dictionary."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from adaptive_flot.contracts import Setup
from adaptive_flot.errors import ScenarioError, located, near_match
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.effect_entry import attach
from adaptive_flot.processes.registry import make_model
from adaptive_flot.resources import scenario_folder
from adaptive_flot.runner.scenario.checks import check_scenario
from adaptive_flot.runner.scenario.keys import ScenarioFile
from adaptive_flot.runner.scenario.recorded_inputs import with_values
from adaptive_flot.runner.scenario.scenario import Scenario
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import read_yaml


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
    raise ScenarioError(f"{name}: no such scenario file; {near_match(path.stem, shipped, 'shipped')}")


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
    content = read_yaml(path, ScenarioError, "holds no keys; see `adaptive-flot scenarios` for examples to copy")
    try:
        file = ScenarioFile.model_validate(content)
    except ValidationError as error:
        raise ScenarioError(f"{path}: {first_problem(error, ScenarioFile)}") from error
    with located(path):
        model = attach(make_model(file.model, cell=file.cell, folder=path.parent), file.effects)
        file = file.model_copy(update={"inputs": with_values(file.inputs, model, path.parent)})
        plant = _plant_model(file, model, path.parent)
        scenario = Scenario(path.stem, path, file, model, _setup(file, model), plant)
        check_scenario(scenario)
    return scenario


def _plant_model(file: ScenarioFile, model: Model, folder: Path) -> Model:
    """That of the estimators where the file does not tell them apart."""
    part = file.plant
    if part.cell is None:
        return model if part.effects is None else attach(model.without_effects(), part.effects, "plant.effects")
    with located("plant.cell"):
        plant = make_model(file.model, cell=part.cell, folder=folder)
    if part.effects is None:
        return attach(plant, file.effects)
    return attach(plant, part.effects, "plant.effects")


def _setup(file: ScenarioFile, model: Model) -> Setup:
    parameters = model.expand_parameters(file.adapt.parameters)
    outputs = tuple(model.outputs[i].name for i in model.indices("outputs", file.adapt.outputs))
    unmeasured = [o for o in outputs if o not in file.measurements]
    if unmeasured:
        raise ScenarioError(f"adapt.outputs: {unmeasured[0]!r} is not among the measurements; add it there")
    disturbed = [name for name, part in file.disturbances.items() if not part.measured]
    of_model = set(model.names("parameters")) - set(parameters)
    hidden = tuple(name for name in disturbed if name in of_model)
    return Setup(model, file.sampling_s, parameters, outputs, unmeasured=hidden)
