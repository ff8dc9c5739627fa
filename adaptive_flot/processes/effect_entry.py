"""An effect as model files and scenarios write it: numbers with their units, checked against the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import Field, model_validator

from adaptive_flot.errors import ModelError, located
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import Model
from adaptive_flot.yaml_files.part import Part


class _Entry(Part):
    """A number and its unit; a bare number is one without a unit."""

    unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, given: Any) -> Any:
        return given if isinstance(given, dict) else {"value": given}


class CoefficientEntry(_Entry):
    """A coefficient."""

    value: float


class SettingEntry(_Entry):
    """A setting: one number or several."""

    value: list[float] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _several(cls, given: Any) -> Any:
        given = given if isinstance(given, dict) else {"value": given}
        value = given.get("value")
        return {**given, "value": value if isinstance(value, list) else [value]} if "value" in given else given

    @property
    def setting(self) -> float | tuple[float, ...]:
        """As `Effect.settings` wants it."""
        return self.value[0] if len(self.value) == 1 else tuple(self.value)


class EffectEntry(Part):
    """One effect of a model file or a scenario; names as in `Effect`."""

    site: str
    driver: str
    form: str
    coefficients: dict[str, CoefficientEntry] = Field(default_factory=dict)
    settings: dict[str, SettingEntry] = Field(default_factory=dict)
    mode: Mode | None = None

    def effect(self, model: Model) -> Effect:
        """The effect, its units checked against the site and driver of a model.

        Raises
        ------
        ModelError
            A unit is missing or another one than the model's, or the effect itself is wrong (see `Effect`).
        """
        effect = Effect(
            self.site,
            self.driver,
            self.form,
            {name: entry.value for name, entry in self.coefficients.items()},
            {name: entry.setting for name, entry in self.settings.items()},
            self.mode,
        )
        units = model.effect_units(effect)
        for kind, entries in (("coefficients", self.coefficients), ("settings", self.settings)):
            for name, entry in entries.items():
                with located(f"{kind}.{name}"):
                    _check_unit(entry, units[name])
        return effect


def _check_unit(entry: CoefficientEntry | SettingEntry, unit: str | None) -> None:
    if unit is None or entry.unit == unit or (entry.unit is None and unit == "-"):
        return
    value = entry.value
    if entry.unit is None:
        shown = value[0] if isinstance(value, list) and len(value) == 1 else value
        raise ModelError(f"{shown!r} has no unit; write {{value: {shown}, unit: {unit}}}")
    raise ModelError(f"given in {entry.unit!r}; convert the value and write unit: {unit}")


def attach(model: Model, entries: Sequence[EffectEntry], where: str = "effects") -> Model:
    """Return the model with the effects of a file; a message on one of them names its place, counted from 1.

    Raises
    ------
    ModelError
        An effect does not fit the model.
    """
    for k, entry in enumerate(entries):
        with located(f"{where}, number {k + 1}"):
            model = model.with_effects([entry.effect(model)])
    return model


def as_entry(effect: Effect, model: Model) -> dict[str, Any]:
    """Plain values for YAML, which `EffectEntry` reads: a number with a unit carries it."""
    units = model.effect_units(effect)

    def number(name: str, value: float | Sequence[float]) -> Any:
        plain = [float(v) for v in value] if isinstance(value, Sequence) else float(value)
        return plain if units[name] in (None, "-") else {"value": plain, "unit": units[name]}

    entry: dict[str, Any] = {"site": effect.site, "driver": effect.driver, "form": effect.form}
    entry["coefficients"] = {name: number(name, value) for name, value in effect.coefficients.items()}
    if effect.settings:
        entry["settings"] = {name: number(name, value) for name, value in effect.settings.items()}
    if effect.mode:
        entry["mode"] = effect.mode
    return entry
