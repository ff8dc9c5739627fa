"""The map from the tags of a plant to the quantities of a model: a YAML file.

::

    time: {column: Timestamp, zone: Europe/London}
    grid: {step: 10 s, hold_at_most: 30 s, gaps: split}
    air_flow: {tag: FIC_101.PV, unit: L/min, bad: [Bad Input, -9999]}
    concentrate_grade: {tag: AI_401.PV, unit: "%", delay: 90 s}
    feed_flow: {constant: 10, unit: L/min}

The importer and the live link read the same file. This module needs neither pandas nor a model.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from adaptive_flot.errors import DataError, near_match
from adaptive_flot.records.map_values import Codes, Duration, TimeForm, UnitText, Zone
from adaptive_flot.records.units import seconds
from adaptive_flot.yaml_files.problems import first_problem
from adaptive_flot.yaml_files.read import line_of, read_yaml

SECTIONS = ("file", "time", "grid")
"""Keys of the outermost level that are no quantities."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FileKeys(_Part):
    """How the file is to be read, where it does not say so itself; a key left out is found out."""

    sheet: str | None = None
    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    form: Literal["wide", "long"] | None = None
    """wide: a column a tag. long: a row a value, with the columns named by the keys below."""
    tag: str | None = None
    value: str | None = None
    quality: str | None = None
    good: Codes | None = None
    """What the quality of a good value is; default `Good`, `OK`, 192 and the like."""


class TimeKeys(_Part):
    """Where the time stands, and what clock it is of.

    `column` is one column, or two (date, then time of day). `zone` counts where the stamps have no offset of their own.
    """

    column: str | tuple[str, str] | None = None
    zone: Zone | None = None
    format: TimeForm | None = None


class GridKeys(_Part):
    """The rows of the record.

    `step` is the sampling interval. An input is held for `hold_at_most` after its last value; after that it is missing,
    which is a gap. `gaps`: `split` the record into stretches, keep the `longest` one, or `refuse`.
    """

    step: Duration | None = None
    hold_at_most: Duration | None = None
    gaps: Literal["split", "longest", "refuse"] = "split"


class TagKeys(_Part):
    """One quantity of the model, and the tag that measures it.

    Attributes
    ----------
    tag
        Column of the file, or name in its tag column.
    unit
        Unit of the tag.
    bad
        Texts and numbers that stand for no value.
    delay
        How much later than the process the tag shows a value: the analyser's sample line, for example.
    hold_at_most
        For how long an input is held, where that of the grid does not suit: a set-point logged as it changes.
    average
        `interval`: the mean over each interval of the grid (of an input: over the time it acted). `sample`: the value
        at the time of the row (of an input: at the start of the interval). Default: interval for an input, else sample.
    repeats
        `drop`: a value equal to the one before is no new measurement, as an analyser shows that holds.
    frozen
        Values that do not change for longer than this count as bad.
    spikes
        `drop`: values far from their neighbours count as bad.
    range
        Lowest and highest good value, in the tag's unit; default the physical range of the quantity.
    """

    tag: str
    unit: UnitText | None = None
    bad: Codes = ()
    delay: Duration | None = None
    hold_at_most: Duration | None = None
    average: Literal["interval", "sample"] | None = None
    repeats: Literal["keep", "drop"] = "keep"
    frozen: Duration | None = None
    spikes: Literal["keep", "drop"] = "keep"
    range: tuple[float, float] | None = None

    @property
    def delay_s(self) -> float:
        """The delay [s]."""
        return 0.0 if self.delay is None else seconds(self.delay)

    @property
    def hold_s(self) -> float | None:
        """For how long the input is held [s]; None where the grid says it."""
        return None if self.hold_at_most is None else seconds(self.hold_at_most)

    @property
    def frozen_s(self) -> float | None:
        """Longest time [s] without change of a good signal; None where it may stand still."""
        return None if self.frozen is None else seconds(self.frozen)


class ConstantKeys(_Part):
    """An input that nobody records: its value, and the unit of that."""

    constant: float
    unit: UnitText


class TagMap(_Part):
    """A map file. What it leaves out, an import finds out and asks for; see `adaptive_flot.records.guess`."""

    file: FileKeys = FileKeys()
    time: TimeKeys = TimeKeys()
    grid: GridKeys = GridKeys()
    quantities: dict[str, TagKeys] = Field(default_factory=dict)
    constants: dict[str, ConstantKeys] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, content: Any) -> Any:
        """Put the keys of quantities, which stand beside the sections in the file, together; so of constants."""
        if not isinstance(content, Mapping) or "quantities" in content:
            return content
        sections = {k: v for k, v in content.items() if k in SECTIONS}
        others = {k: v for k, v in content.items() if k not in SECTIONS}
        constants = {k: v for k, v in others.items() if isinstance(v, Mapping) and "constant" in v}
        return {**sections, "quantities": {k: others[k] for k in others if k not in constants}, "constants": constants}

    def names(self, quantity: str) -> bool:
        """Whether it says where a quantity comes from."""
        return quantity in self.quantities or quantity in self.constants

    def with_keys(self, section: str, keys: Mapping[str, object]) -> TagMap:
        """Return this map with further keys in a section or at a quantity."""
        content = self.model_dump(mode="json", exclude_defaults=True)
        place = content.setdefault(section, {}) if section in SECTIONS else content.setdefault("quantities", {})
        if section in SECTIONS:
            place.update(keys)
        else:
            place.setdefault(section, {}).update(keys)
        return TagMap.model_validate({"quantities": {}, **content})

    def check_names(self, known: tuple[str, ...], model: str) -> None:
        """Check that every quantity is one of the model's.

        Raises
        ------
        DataError
            Names the first that is not, and the nearest that is.
        """
        for name in (*self.quantities, *self.constants):
            if name not in known:
                raise DataError(f"{name}: no such quantity of model '{model}'; {near_match(name, known)}")

    def text(self) -> str:
        """The map as YAML, one line a section or quantity, keys at their default left out."""
        content = self.model_dump(mode="json", exclude_defaults=True)
        parts = {k: content[k] for k in SECTIONS if k in content}
        parts |= content.get("quantities", {}) | content.get("constants", {})
        return "".join(
            yaml.safe_dump({k: v}, default_flow_style=None, sort_keys=False, width=10_000, allow_unicode=True)
            if not v
            else f"{k}: {_flow(v)}\n"
            for k, v in parts.items()
        )


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True)
    return str(text).strip()


def load_tag_map(path: Path | str) -> TagMap:
    """Read a map file and check its form.

    Raises
    ------
    DataError
        Not YAML, an unknown key, a wrong type, no unit, no duration, no time zone: file, line, what, and what to do.
    """
    file = Path(path)
    content = read_yaml(file, DataError, "holds no keys; write at least one line as 'air_flow: {tag: FIC_101.PV}'")
    content = {str(k): v for k, v in content.items()}
    try:
        return TagMap.model_validate(content)
    except ValidationError as error:
        place = error.errors()[0]["loc"]
        outer = place[1:] if place[:1] in (("quantities",), ("constants",)) else place
        line = line_of(file, outer)
        problem = first_problem(error, TagMap).replace("quantities.", "", 1).replace("constants.", "", 1)
        raise DataError(f"{file}: {'' if line is None else f'line {line}: '}{problem}") from error
