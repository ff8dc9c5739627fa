"""Model files: YAML that describes a whole model - a process, its calibrated parameters, and further effects.

::

    model: flotation            # or cascaded-tanks, or your own my_file:make_model beside this file
    cell: lab_87l               # flotation only: shipped name, or the path of a cell file from here
    parameters:                 # those that differ from the cell's
      n: {value: 1.02, unit: "-", source: calibrated on record.csv}
    effects:
      - site: bubble_size       # bubbles grow with air: diameter times (air_flow / reference)^exponent
        driver: air_flow
        form: power
        coefficients: {exponent: 0.25}
        settings: {reference: {value: 1.5e-3, unit: m3/s}}

Units are SI, and a number that has one carries it, as in a cell file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pydantic import Field, ValidationError

from adaptive_flot.errors import ModelError, located
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.effect_entry import EffectEntry, attach
from adaptive_flot.yaml_files.part import Part
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import read_yaml

SUFFIXES = (".yaml", ".yml")


class ParameterEntry(Part):
    """A parameter that differs from the process's own."""

    value: float
    unit: str
    source: str


class ModelFile(Part):
    """Keys of a model file."""

    note: str | None = None
    model: str
    cell: str | None = None
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)
    effects: list[EffectEntry] = Field(default_factory=list)

    def extend(self, process: Model) -> Model:
        """Return the model of this file from that of its process.

        Raises
        ------
        ModelError, RangeError
            A parameter or an effect does not fit the process.
        """
        model = process
        for name, entry in self.parameters.items():
            with located(f"parameters.{name}"):
                i = model.index("parameters", name)
                if entry.unit != model.parameters[i].unit:
                    unit = model.parameters[i].unit
                    raise ModelError(f"given in {entry.unit!r}; convert the value and write unit: {unit}")
                model = model.with_parameters({name: entry.value})
                sourced = (*model.parameters[:i], replace(model.parameters[i], source=entry.source))
                model = replace(model, parameters=(*sourced, *model.parameters[i + 1 :]))
        return attach(model, self.effects)


def is_model_file(name: str) -> bool:
    """Tell a model file from the name of a process.

    >>> is_model_file("extended.yaml"), is_model_file("flotation")
    (True, False)
    """
    return name.endswith(SUFFIXES)


def find_model_file(name: str, folder: Path | None = None) -> Path:
    """Path of a model file, relative to the folder of the file that names it, or to here.

    Raises
    ------
    ModelError
        There is none.
    """
    for place in (*([folder / name] if folder else []), Path(name)):
        if place.is_file():
            return place
    raise ModelError(f"{name}: no such model file; give the path of one, or the name of a process")


def load_model_file(path: Path) -> ModelFile:
    """Read a model file and check its form; `ModelFile.extend` checks it against its process.

    Raises
    ------
    ModelError
        Not YAML, an unknown or missing key, a wrong type.
    """
    content = read_yaml(path, ModelError, "holds no keys; write at least 'model: flotation'")
    try:
        file = ModelFile.model_validate(content)
    except ValidationError as error:
        raise ModelError(f"{path}: {first_problem(error, ModelFile)}") from error
    if is_model_file(file.model):
        raise ModelError(f"{path}: model: {file.model} is a model file itself; name a process, and its effects here")
    return file
