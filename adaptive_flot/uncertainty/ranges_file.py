"""The file of the ranges: a cell, and how far each uncertain constant may be off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from scipy import stats

from adaptive_flot.errors import CellError, located
from adaptive_flot.greybox.model import FloatArray, Model, Parameter
from adaptive_flot.processes.registry import find_cell, make_model
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import read_yaml

HINT = "give `cell:` and `uncertain:` with a range for each constant, for example `n: {share: 0.05}`"


class RangePart(BaseModel):
    """How far one constant may be off; exactly one of the three is given.

    Attributes
    ----------
    between
        Lowest and highest value, all between them equally likely, in the constant's unit.
    std
        Standard deviation around the cell's value, in its unit; normal, cut at the constant's physical range.
    share
        The same as a share of the cell's value.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    between: tuple[float, float] | None = None
    std: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    share: float | None = Field(default=None, gt=0, allow_inf_nan=False)

    @model_validator(mode="after")
    def _one(self) -> RangePart:
        if sum(v is not None for v in (self.between, self.std, self.share)) != 1:
            raise ValueError("give one of between, std and share")
        return self


class RangesFile(BaseModel):
    """A file of ranges.

    Attributes
    ----------
    cell
        Cell file (relative to this file), or the name of a shipped one; default the laboratory cell.
    uncertain
        Range of each uncertain constant, by name or symbol.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    cell: str | None = None
    uncertain: dict[str, RangePart] = Field(min_length=1)


@dataclass(frozen=True)
class Uncertain:
    """An uncertain constant: its parameter, and the quantile function of its value."""

    parameter: Parameter
    part: RangePart

    def values(self, shares: FloatArray) -> FloatArray:
        """Values (N,) at cumulative probabilities (N,) in (0, 1)."""
        if self.part.between is not None:
            low, high = self.part.between
            return low + (high - low) * shares
        p = self.parameter
        ends = (p.lower - p.value) / self.std, (p.upper - p.value) / self.std
        return np.asarray(stats.truncnorm.ppf(shares, *ends, loc=p.value, scale=self.std), dtype=float)

    @property
    def std(self) -> float:
        """Standard deviation of the normal distribution, in the constant's unit."""
        return self.part.std or (self.part.share or 0.0) * abs(self.parameter.value)

    @property
    def in_words(self) -> str:
        """The range as it was given."""
        unit = "" if self.parameter.unit == "-" else f" {self.parameter.unit}"
        if self.part.between is not None:
            return f"{self.part.between[0]:g} to {self.part.between[1]:g}{unit}"
        return f"{self.parameter.value:g} ± {self.std:.3g}{unit}"


@dataclass(frozen=True)
class Ranges:
    """A model with uncertain constants, and the files it was read from."""

    model: Model
    constants: tuple[Uncertain, ...]
    files: tuple[Path, ...]


def ranges_files(path: Path) -> list[Path]:
    """Files from which ranges are read: the file itself, and its cell.

    Raises
    ------
    CellError
        One is not there, or the file can not be used.
    """
    with located(path):
        return [path, find_cell(_load(path).cell, path.parent)]


def read_ranges(path: Path) -> Ranges:
    """Read a file of ranges.

    Raises
    ------
    CellError
        File missing, unknown key, a range outside the constant's physical range.
    ModelError
        Unknown constant.
    """
    file = _load(path)
    with located(path):
        model = make_model(cell=file.cell, folder=path.parent)
        constants = [
            _uncertain(model, name, part) for given, part in file.uncertain.items() for name in _full(model, given)
        ]
        model.expand_parameters([c.parameter.name for c in constants])  # no constant twice
    return Ranges(model, tuple(constants), tuple(ranges_files(path)))


def _load(path: Path) -> RangesFile:
    if not path.is_file():
        raise CellError(f"{path}: no such file of ranges; {HINT}")
    content: Mapping[str, object] = read_yaml(path, CellError, f"holds no ranges; {HINT}")
    if "uncertain" not in content:
        raise CellError(f"{path}: holds no ranges (no key 'uncertain'); {HINT}")
    try:
        return RangesFile.model_validate(content)
    except ValidationError as error:
        raise CellError(f"{path}: {first_problem(error, RangesFile)}") from error


def _full(model: Model, name: str) -> tuple[str, ...]:
    with located("uncertain"):
        return model.expand_parameters([name])


def _uncertain(model: Model, name: str, part: RangePart) -> Uncertain:
    parameter = model.parameters[model.index("parameters", name)]
    if part.between is not None:
        low, high = part.between
        if not (parameter.lower <= low < high <= parameter.upper and np.isfinite([low, high]).all()):
            raise CellError(
                f"uncertain.{parameter.label}: between {low:g} and {high:g} {parameter.unit}; give the lower value "
                f"first, both within [{parameter.lower:g}, {parameter.upper:g}]"
            )
    elif part.share is not None and parameter.value == 0:
        raise CellError(f"uncertain.{parameter.label}: a share of 0 {parameter.unit} is nothing; give std or between")
    return Uncertain(parameter, part)
