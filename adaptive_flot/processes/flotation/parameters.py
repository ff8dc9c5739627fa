"""Cell files: every number of a flotation cell with its value, unit and source, checked once when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from adaptive_flot.errors import CellError, near_match
from adaptive_flot.files import replace_file
from adaptive_flot.greybox.model import Parameter
from adaptive_flot.resources import cell_file


@dataclass(frozen=True)
class _Spec:
    """What a cell file must hold under one key: name in the model, unit, physical range, symbol."""

    name: str
    unit: str
    lower: float
    upper: float = np.inf
    symbol: str | None = None
    group: Literal["mineral", "bubble"] | None = None


_TINY = 1e-12
_PARAMETERS: dict[str, dict[str, _Spec]] = {
    "cell": {
        "cross_section_area": _Spec("cross_section_area", "m2", _TINY, symbol="A"),
        "volume": _Spec("volume", "m3", _TINY),
        "height": _Spec("height", "m", _TINY, symbol="h_T"),
    },
    "pulp": {
        "solids_fraction": _Spec("solids_fraction", "-", 0.0, 0.9, symbol="phi"),
        "solids_density": _Spec("solids_density", "kg/m3", 1000.0, 2e4),
        "water_density": _Spec("water_density", "kg/m3", 500.0, 2000.0),
        "water_viscosity": _Spec("water_viscosity", "Pa s", 1e-5, 1.0),
        "gravity": _Spec("gravity", "m/s2", _TINY, 100.0, symbol="g"),
    },
    "bubbles": {
        "diameter": _Spec("bubble_diameter", "m", 1e-6, 0.1, group="bubble"),
        "number": _Spec("bubble_number", "-", 0.0, group="bubble"),
    },
    "froth": {
        "growth_exponent": _Spec("growth_exponent", "-", 0.3, 5.0, symbol="n"),
        "coalescence_rate": _Spec("coalescence_rate", "m^n/s", 1e-6, 0.1, symbol="C"),
        "burst_a": _Spec("burst_a", "m/s", -0.1, 0.1, symbol="a"),
        "burst_b": _Spec("burst_b", "-", 0.0, 1.0, symbol="b"),
        "burst_c": _Spec("burst_c", "s/m", -100.0, 100.0, symbol="c"),
        "drag_coefficient": _Spec("drag_coefficient", "-", 1.0, 1000.0, symbol="C_PB"),
        "plateau_border": _Spec("plateau_border", "-", 0.1, 100.0),
        "peclet": _Spec("peclet", "-", 1e-3, 100.0, symbol="Pe"),
    },
    "minerals": {
        "floatability": _Spec("floatability", "-", 0.0, 0.1, group="mineral"),
        "particle_diameter": _Spec("particle_diameter", "m", 1e-7, 1e-2, group="mineral"),
        "density": _Spec("mineral_density", "kg/m3", 1001.0, 2.5e4, group="mineral"),
        "feed_concentration": _Spec("feed_concentration", "kg/m3", 0.0, 2e4, group="mineral"),
    },
    "level_loop": {
        "proportional_gain": _Spec("proportional_gain", "m2/s", _TINY, 10.0, symbol="k_p"),
        "integral_time": _Spec("integral_time", "s", 0.1, 1e6, symbol="tau_i"),
    },
}
_OPERATION_UNITS = {
    "feed_flow": "m3/s",
    "air_flow_limits": "m3/s",
    "air_flow_valid": "m3/s",
    "level_limits": "m",
    "grade_noise": "-",
}


class _Entry(BaseModel):
    """One entry of a cell file."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    value: float | list[float]
    unit: str
    source: str
    bounds: tuple[float, float] | None = None
    prior_std: float | list[float] | None = None
    role: Literal["fixed", "estimated"] = "fixed"

    @property
    def values(self) -> list[float]:
        return self.value if isinstance(self.value, list) else [self.value]


@dataclass(frozen=True)
class Cell:
    """A flotation cell: model parameters, mineral names and operating values, all in SI units.

    `operation` holds `feed_flow` (1,), `air_flow_limits` and `level_limits` (2,: where the cell is run),
    `air_flow_valid` (2,: where the model means anything), `grade_noise` (1,: standard deviation).
    """

    name: str
    parameters: tuple[Parameter, ...]
    minerals: tuple[str, ...]
    bubble_classes: int
    operation: Mapping[str, tuple[float, ...]]

    def value(self, name: str) -> float:
        """Value of a parameter by name or symbol."""
        return next(p.value for p in self.parameters if name in (p.name, p.symbol))


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
    _reject_unknown(file, "", content, [*_PARAMETERS, "operation"])
    minerals = _mineral_names(file, content)
    parameters: list[Parameter] = []
    sizes = {"mineral": len(minerals), "bubble": 0}
    for section, specs in _PARAMETERS.items():
        given = _section(file, content, section)
        _reject_unknown(file, section, given, [*specs, *(["names"] if section == "minerals" else [])])
        for key, spec in specs.items():
            entry = _entry(file, given, section, key, spec.unit)
            if spec.group == "bubble" and not sizes["bubble"]:
                sizes["bubble"] = len(entry.values)
            count = sizes[spec.group] if spec.group else 1
            if len(entry.values) != count:
                raise CellError(
                    f"{file}: {section}.{key} has {len(entry.values)} values; give {count}, one a {spec.group}"
                )
            labels = minerals if spec.group == "mineral" else [str(i + 1) for i in range(count)]
            parameters += _parameters(file, section, key, spec, entry, labels)
    cell = Cell(file.stem, tuple(parameters), tuple(minerals), sizes["bubble"], _operation(file, content))
    _check_air(file, cell)
    return cell


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
    """
    content = _load(Path(source))
    minerals = _mineral_names(Path(source), content)
    for section, specs in _PARAMETERS.items():
        for key, spec in specs.items():
            labels = minerals if spec.group == "mineral" else [str(i + 1) for i in range(1000)]
            entry = content[section][key]
            if spec.group is None and spec.name in values:
                entry["value"], entry["source"] = float(values[spec.name]), note
            elif spec.group is not None:
                changed = {
                    i: values[f"{spec.name}.{labels[i]}"]
                    for i in range(len(entry["value"]))
                    if f"{spec.name}.{labels[i]}" in values
                }
                if changed:
                    entry["value"] = [float(changed.get(i, v)) for i, v in enumerate(entry["value"])]
                    entry["source"] = note
    with replace_file(Path(path)) as stream:
        yaml.safe_dump(content, stream, sort_keys=False, default_flow_style=None)


def _load(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise CellError(f"{file}: no such cell file; see scenarios/cells/ for one to copy")
    try:
        content = yaml.safe_load(file.read_text())
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CellError(f"{file}: not a YAML file ({str(error).splitlines()[0]}); correct it") from error
    if not isinstance(content, dict):
        raise CellError(f"{file}: holds no entries; see scenarios/cells/ for one to copy")
    return content


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
        raise CellError(f"{where}.{place}: {first['msg']}, got {first.get('input')!r}; correct it") from error
    if entry.unit != unit:
        raise CellError(f"{where} is given in {entry.unit!r}; convert the value and write unit: {unit}")
    return entry


def _parameters(file: Path, section: str, key: str, spec: _Spec, entry: _Entry, labels: list[str]) -> list[Parameter]:
    lower, upper = entry.bounds or (spec.lower, spec.upper)
    prior = entry.prior_std if isinstance(entry.prior_std, list) else [entry.prior_std] * len(entry.values)
    found = []
    for label, value, std in zip(labels, entry.values, prior, strict=False):
        name = f"{spec.name}.{label}" if spec.group else spec.name
        if not (np.isfinite(value) and max(lower, spec.lower) <= value <= min(upper, spec.upper)):
            raise CellError(
                f"{file}: {section}.{key} = {value:g} {spec.unit} is outside its physical range "
                f"[{max(lower, spec.lower):g}, {min(upper, spec.upper):g}] {spec.unit}; correct the value or its unit"
            )
        scale = abs(value) or 1.0
        found.append(
            Parameter(
                name,
                value,
                spec.unit,
                entry.source,
                spec.symbol,
                max(lower, spec.lower),
                min(upper, spec.upper),
                scale,
                std,
                entry.role,
            )
        )
    return found


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
    _reject_unknown(file, "operation", given, list(_OPERATION_UNITS))
    values: dict[str, tuple[float, ...]] = {}
    for key, unit in _OPERATION_UNITS.items():
        if key == "air_flow_valid" and key not in given:
            continue
        values[key] = tuple(_entry(file, given, "operation", key, unit).values)
        low, high = values[key][0], values[key][-1]
        if len(values[key]) != (2 if key.endswith(("limits", "valid")) else 1) or not 0 <= low <= high:
            raise CellError(f"{file}: operation.{key} = {list(values[key])}; give positive values, lower one first")
    return values


def _check_air(file: Path, cell: Cell) -> None:
    """Fill in the air range in which the burst-rate line means anything, v_b >= 0, and check the limits against it."""
    area, a, b, c = (cell.value(n) for n in ("cross_section_area", "burst_a", "burst_b", "burst_c"))
    roots = np.roots([c, b, a]) if c else np.array([-a / b if b else 0.0])
    positive = [float(r.real) for r in roots if abs(r.imag) < 1e-15 and r.real > 0]
    lowest = area * min(positive, default=0.0)
    limits = cell.operation["air_flow_limits"]
    valid = cell.operation.get("air_flow_valid", (lowest, 0.03 * area))
    valid = (max(valid[0], lowest), valid[1])
    if not valid[0] <= limits[0] <= limits[1] <= valid[1]:
        raise CellError(
            f"{file}: operation.air_flow_limits {list(limits)} m3/s leave the range {list(valid)} m3/s in which the "
            "bursting rate is positive and known; correct the limits or froth.burst_a/b/c"
        )
    operation = cell.operation
    assert isinstance(operation, dict)
    operation["air_flow_valid"] = valid


__all__ = ["Cell", "CellError", "default_cell", "read_cell", "replace", "save_cell"]
