"""Cell files: every number of a flotation cell with its value, unit and source, checked once when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from adaptive_flot.errors import CellError, near_match
from adaptive_flot.files import replace_file
from adaptive_flot.greybox.model import Parameter
from adaptive_flot.processes.flotation.parameters import OPERATION_UNITS, PARAMETERS, Cell, Spec
from adaptive_flot.resources import cell_file
from adaptive_flot.yaml_files.problems import in_words
from adaptive_flot.yaml_files.read import read_yaml

HIGHEST_GAS_VELOCITY = 0.03
"""Superficial gas velocity [m/s] up to which a cell file without `air_flow_valid` is trusted."""


class _Entry(BaseModel):
    """One entry of a cell file."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    value: float | list[float]
    unit: str
    source: str
    bounds: tuple[float, float] | None = None
    scale: float | list[float] | None = None
    prior_std: float | list[float] | None = None
    role: Literal["fixed", "estimated"] = "fixed"

    @property
    def values(self) -> list[float]:
        return self.value if isinstance(self.value, list) else [self.value]


def default_cell() -> Cell:
    """Return the 87-litre laboratory cell of the paper."""
    return read_cell(cell_file())


def read_cell(path: Path | str) -> Cell:
    """Read and check a cell file (YAML; every entry with value, unit and source).

    Raises
    ------
    CellError
        File or entry missing, unknown entry, unit missing or different, value outside its physical range.
    """
    file = Path(path)
    content = _load(file)
    _reject_unknown(file, "", content, [*PARAMETERS, "operation"])
    minerals = _mineral_names(file, content)
    parameters: list[Parameter] = []
    sizes = {"mineral": len(minerals), "bubble": 0}
    for section, specs in PARAMETERS.items():
        given = _section(file, content, section)
        _reject_unknown(file, section, given, [*specs, *(["names"] if section == "minerals" else [])])
        for key, spec in specs.items():
            entry = _entry(file, given, section, key, spec.unit)
            if spec.group == "bubble" and not sizes["bubble"]:
                sizes["bubble"] = len(entry.values)
            count = sizes[spec.group] if spec.group else 1
            if len(entry.values) != count or count == 0:
                wanted = f"{count}, one a {spec.group}" if count > 1 else "one"
                raise CellError(f"{file}: {section}.{key} has {len(entry.values)} values; give {wanted}")
            labels = minerals if spec.group == "mineral" else [str(i + 1) for i in range(count)]
            parameters += _parameters(file, section, key, spec, entry, labels)
    cell = Cell(file.stem, tuple(parameters), tuple(minerals), sizes["bubble"], _operation(file, content))
    _check(file, cell)
    return replace(cell, operation={**cell.operation, "air_flow_valid": _air_range(file, cell)})


def save_cell(source: Path | str, values: Mapping[str, float], note: str, path: Path | str) -> None:
    """Write a copy of a cell file with some parameter values replaced, whole or not at all.

    Parameters
    ----------
    source
        The cell file to start from.
    values
        New values by full parameter name, each in the parameter's unit.
    note
        Becomes the source of each replaced value, e.g. "calibrated on record.csv".
    path
        The file to write.

    Raises
    ------
    CellError
        The source can not be read, or a name is not in it.
    """
    content = _load(Path(source))
    minerals = _mineral_names(Path(source), content)
    left = set(values)
    for section, specs in PARAMETERS.items():
        for key, spec in specs.items():
            entry = content[section][key]
            several = isinstance(entry["value"], list)
            old = entry["value"] if several else [entry["value"]]
            labels = minerals if spec.group == "mineral" else [str(i + 1) for i in range(len(old))]
            names = [f"{spec.name}.{label}" if spec.group else spec.name for label in labels]
            if left & set(names):
                new = [float(values.get(name, v)) for name, v in zip(names, old, strict=True)]
                entry["value"], entry["source"] = new if several else new[0], note
                left -= set(names)
    if left:
        raise CellError(f"{source}: no parameter {sorted(left)[0]!r} in a cell file; save those of the cell only")
    with replace_file(Path(path)) as stream:
        yaml.safe_dump(content, stream, sort_keys=False, default_flow_style=None)


def _load(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise CellError(f"{file}: no such cell file; see scenarios/cells/ for one to copy")
    return read_yaml(file, CellError, "holds no entries; see scenarios/cells/ for one to copy")


def _section(file: Path, content: Mapping[str, Any], section: str) -> dict[str, Any]:
    given = content.get(section)
    if not isinstance(given, dict):
        raise CellError(f"{file}: section {section!r} is missing; add it with its entries")
    return given


def _reject_unknown(file: Path, section: str, given: Mapping[str, Any], known: list[str]) -> None:
    for key in given:
        if key not in known:
            where = f"section {section!r} has" if section else "has"
            raise CellError(f"{file}: {where} the unknown entry {key!r}; {near_match(str(key), known)}")


def _entry(file: Path, given: Mapping[str, Any], section: str, key: str, unit: str) -> _Entry:
    where = f"{file}: {section}.{key}"
    if key not in given:
        raise CellError(f"{where} is missing; add {{value: ..., unit: {unit}, source: ...}}")
    raw = given[key]
    if not isinstance(raw, dict):
        raise CellError(f"{where} = {raw!r} has no unit; write {{value: {raw}, unit: {unit}, source: ...}}")
    for need in ("value", "unit", "source"):
        if need not in raw:
            raise CellError(f"{where} has no {need}; write {{value: ..., unit: {unit}, source: ...}}")
    try:
        entry = _Entry.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(p) for p in first["loc"][:1])
        raise CellError(f"{where}.{place}: {in_words(first)}, got {first.get('input')!r}; correct it") from error
    if entry.unit != unit:
        raise CellError(f"{where} is given in {entry.unit!r}; convert the value and write unit: {unit}")
    return entry


def _parameters(file: Path, section: str, key: str, spec: Spec, entry: _Entry, labels: list[str]) -> list[Parameter]:
    given = entry.bounds or (spec.lower, spec.upper)
    lower, upper = max(given[0], spec.lower), min(given[1], spec.upper)
    scales, priors = _each(entry.scale, labels), _each(entry.prior_std, labels)
    if not len(scales) == len(priors) == len(labels):
        raise CellError(
            f"{file}: {section}.{key}: give scale and prior_std once, or one for each of {len(labels)} values"
        )
    entries = []
    for label, value, scale, prior in zip(labels, entry.values, scales, priors, strict=True):
        where = f"{file}: {section}.{key}"
        if not (np.isfinite(value) and lower <= value <= upper):
            raise CellError(
                f"{where} = {value:g} {spec.unit} is outside its physical range [{lower:g}, {upper:g}] {spec.unit}; "
                "correct the value or its unit"
            )
        if (scale is not None and not scale > 0) or (prior is not None and not prior > 0):
            raise CellError(f"{where}: scale and prior_std must be positive, got {scale} and {prior}; correct them")
        entries.append(
            Parameter(
                name=f"{spec.name}.{label}" if spec.group else spec.name,
                value=value,
                unit=spec.unit,
                source=entry.source,
                symbol=spec.symbol,
                lower=lower,
                upper=upper,
                scale=scale or abs(value) or 1.0,
                prior_std=prior,
                role=entry.role,
                disturbance=spec.disturbance,
                drifts=spec.drifts,
            )
        )
    return entries


def _each(value: float | list[float] | None, labels: list[str]) -> list[float | None]:
    """One value for each component: the list given, or the same value for all."""
    return [*value] if isinstance(value, list) else [value] * len(labels)


def _mineral_names(file: Path, content: Mapping[str, Any]) -> list[str]:
    given = _section(file, content, "minerals").get("names")
    names = given if isinstance(given, list) and all(isinstance(n, str) for n in given) else []
    if len(names) < 2 or len(set(names)) != len(names):
        raise CellError(
            f"{file}: minerals.names must be a list of words, got {given!r}; "
            "give at least two different names, the valuable one first"
        )
    return [str(n) for n in names]


def _operation(file: Path, content: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    given = _section(file, content, "operation")
    _reject_unknown(file, "operation", given, list(OPERATION_UNITS))
    values: dict[str, tuple[float, ...]] = {}
    for key, unit in OPERATION_UNITS.items():
        if key == "air_flow_valid" and key not in given:
            continue
        values[key] = tuple(_entry(file, given, "operation", key, unit).values)
        count = 2 if key.endswith(("limits", "valid")) else 1
        if len(values[key]) != count or not 0 <= values[key][0] <= values[key][-1] < np.inf:
            raise CellError(f"{file}: operation.{key} = {list(values[key])}; give positive values, lower one first")
    return values


def _check(file: Path, cell: Cell) -> None:
    """Check entries against each other."""
    if not sum(p.value for p in cell.parameters if p.name.startswith("bubble_number.")) > 0:
        raise CellError(f"{file}: bubbles.number holds no bubbles; give at least one positive number")
    height, limits = cell.value("height"), cell.operation["level_limits"]
    if limits[1] >= height:
        raise CellError(
            f"{file}: operation.level_limits {list(limits)} m reach above the cell ({height:g} m); correct them"
        )


def _air_range(file: Path, cell: Cell) -> tuple[float, float]:
    """Air flows [m3/s] around the operating limits in which the burst-rate line means anything: v_b >= 0."""
    area, a, b, c = (cell.value(n) for n in ("cross_section_area", "burst_a", "burst_b", "burst_c"))
    limits = cell.operation["air_flow_limits"]
    low, high = cell.operation.get("air_flow_valid", (0.0, HIGHEST_GAS_VELOCITY * area))
    zeros = [area * float(r.real) for r in np.roots([c, b, a]) if abs(r.imag) < 1e-15]  # v_b changes its sign here
    low = max([low, *(z for z in zeros if z <= limits[0])])
    high = min([high, *(z for z in zeros if z > limits[0])])
    jg = limits[0] / area
    if a + b * jg + c * jg**2 < 0 or not low <= limits[0] <= limits[1] <= high:
        raise CellError(
            f"{file}: operation.air_flow_limits {list(limits)} m3/s leave the range [{low:g}, {high:g}] m3/s in which "
            "the bursting rate is positive and known; correct the limits or froth.burst_a/b/c"
        )
    return low, high
