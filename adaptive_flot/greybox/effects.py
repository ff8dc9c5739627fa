"""An effect: a physical term attached to a site of a model, driven by one of the model's own quantities.

`Model.with_effects` returns a model whose equations carry the term; its coefficients are parameters, its filters are
states. Plant, estimators and controllers use the extended model like any other.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.forms.catalogue import FORMS
from adaptive_flot.greybox.forms.form import Coefficient, CoefficientRole, Form, Settings, wrong_setting
from adaptive_flot.greybox.quantities import Parameter, Quantity

Mode = Literal["factor", "offset"]
LATE = ("lag", "delay")
"""What makes the value at a site late."""
DYNAMIC_DRIVERS = (*LATE, "saturation")
"""What acts on the value at a site itself: it is delayed, or limited."""
STATELESS_DRIVERS = ("constant", "time", "own_value", *DYNAMIC_DRIVERS)


@dataclass(frozen=True)
class Effect:
    """A term at a site.

    Attributes
    ----------
    site
        Name of the site where it acts.
    driver
        What it depends on: an input, a state or a signal of the model that is known where the site is passed;
        "constant" or "time"; "own_value" where it acts on the value itself (a part that leaks, an instrument that does
        not see a sign); "lag", "delay" or "saturation" for the forms of that kind.
    form
        Name of a family in `FORMS`.
    coefficients
        Values by name; those left out do nothing.
    settings
        Fixed numbers of the form: reference of the driver, knots, number of stages.
    mode
        "factor" multiplies the value by exp(g), "offset" adds g in the site's unit; default the site's own way.

    Raises
    ------
    ModelError
        Unknown form, coefficient or setting, a coefficient outside its range, or a setting that is missing.
    """

    site: str
    driver: str
    form: str
    coefficients: Mapping[str, float] = field(default_factory=dict)
    settings: Settings = field(default_factory=dict)
    mode: Mode | None = None

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise ModelError(f"effect at {self.site!r}: unknown form {self.form!r}; {near_match(self.form, FORMS)}")
        family = self.family
        for name in self.settings:
            if name not in family.settings:
                raise ModelError(f"{self.label}: unknown setting {name!r}; {near_match(name, family.settings)}")
        missing = [n for n, default in family.settings.items() if default is None and n not in self.settings]
        if missing:
            raise ModelError(f"{self.label}: setting {missing[0]!r} is missing; give it")
        for name, setting in self.settings.items():
            if problem := wrong_setting(name, setting):
                raise ModelError(f"{self.label}: setting {name} = {setting}: {problem}")
        known = {c.name: c for c in self.terms}
        for name, value in self.coefficients.items():
            if name not in known:
                raise ModelError(f"{self.label}: unknown coefficient {name!r}; {near_match(name, known)}")
            c = known[name]
            if not (np.isfinite(value) and c.lower <= value <= c.upper):
                raise ModelError(f"{self.label}: {name} = {value:g} is outside [{c.lower:g}, {c.upper:g}] {c.unit}")

    @property
    def family(self) -> Form:
        """The form itself: its law, its kind and what it may be asked."""
        return FORMS[self.form]

    @property
    def full_settings(self) -> Settings:
        """Settings with the defaults of the form filled in."""
        defaults = {k: v for k, v in self.family.settings.items() if v is not None}
        return {**defaults, **self.settings}

    @property
    def terms(self) -> tuple[Coefficient, ...]:
        """Coefficients of the form with these settings."""
        return self.family.coefficients(self.full_settings)

    def names(self, *roles: CoefficientRole) -> tuple[str, ...]:
        """Names of the coefficients with one of these roles, in the order of the form."""
        return tuple(c.name for c in self.terms if c.role in roles)

    def values(self, *roles: CoefficientRole) -> list[float]:
        """Values of the given coefficients with one of these roles, in the order in which they are given."""
        wanted = self.names(*roles)
        return [value for name, value in self.coefficients.items() if name in wanted]

    @property
    def levels(self) -> list[float]:
        """Values of the given coefficients that are a change at the site itself: levels, and values at knots."""
        return self.values(CoefficientRole.LEVEL, CoefficientRole.KNOT_VALUE)

    @property
    def label(self) -> str:
        """Name in messages and of the parameters: `bubble_size_by_air_flow`."""
        return f"{self.site}_by_{self.driver}"

    @property
    def structure(self) -> Hashable:
        """What its equations depend on: all but the values of its coefficients."""
        settings = ((name, tuple(np.atleast_1d(value).tolist())) for name, value in sorted(self.settings.items()))
        return self.site, self.driver, self.form, self.mode, tuple(settings)

    @property
    def follower(self) -> str:
        """Name of the state that follows a driver which is known only after the site."""
        return f"{self.label}.driver"

    def parameter(self, coefficient: str) -> str:
        """Full parameter name of a coefficient."""
        return f"{self.label}.{coefficient}"

    def units(self, site: str | None, driver: str | None, mode: Mode) -> dict[str, str | None]:
        """Unit of each coefficient and setting by name; None where it is the site's and that is not known.

        Parameters
        ----------
        site, driver
            Their units, None where unknown.
        mode
            How effects act at the site by default.
        """
        slope = f"{site}/{driver}" if site and driver else None
        g = "-" if (self.mode or mode) == "factor" else site
        known = {"g": g, "value": site, "driver": driver, "value/driver": slope}
        words = {c.name: c.unit for c in self.terms}
        words |= {name: self.family.setting_units.get(name, "-") for name in self.family.settings}
        return {name: known.get(word, word) for name, word in words.items()}

    def parameters(self, units: Mapping[str, str | None] | None = None) -> tuple[Parameter, ...]:
        """Coefficients as model parameters, with their `units` where these are known."""
        source = f"effect: {self.family.description}"
        return tuple(
            Parameter(
                self.parameter(c.name),
                float(self.coefficients.get(c.name, c.default)),
                (units or {}).get(c.name) or c.unit,
                source,
                None,
                c.lower,
                c.upper,
                c.scale,
            )
            for c in self.terms
        )

    def states(self, late_driver: Quantity | None = None) -> tuple[Quantity, ...]:
        """States of its form, and one that follows a driver which is known only after the site."""
        own = tuple(
            Quantity(f"{self.label}.{n}", "-", f"{self.family.description} at {self.site}")
            for n in self.family.states(self.full_settings)
        )
        if late_driver is None:
            return own
        description = f"{late_driver.name} as it reaches {self.site}"
        return (*own, replace(late_driver, name=self.follower, description=description))

    def as_dict(self) -> dict[str, Any]:
        """Plain values for YAML and JSON."""
        settings = {k: list(v) if isinstance(v, tuple) else float(v) for k, v in self.settings.items()}
        plain: dict[str, Any] = {"site": self.site, "driver": self.driver, "form": self.form}
        plain["coefficients"] = {k: float(v) for k, v in self.coefficients.items()}
        if settings:
            plain["settings"] = settings
        if self.mode:
            plain["mode"] = self.mode
        return plain


def check_distinct(effects: Iterable[Effect]) -> None:
    """Two effects with one name would share their parameters.

    Raises
    ------
    ModelError
        Two effects at one site with one driver.
    """
    seen: set[str] = set()
    for effect in effects:
        if effect.label in seen:
            raise ModelError(f"two effects at site {effect.site!r} with driver {effect.driver!r}; give one of them")
        seen.add(effect.label)


def apply(effect: Effect, scope: Any, value: ca.SX, driver: ca.SX, mode: Mode) -> ca.SX:
    """Value of the site with the effect; `scope` gives parameter symbols and the effect's own states."""
    coefficients = {c.name: scope.parameter(effect.parameter(c.name)) for c in effect.terms}
    family, settings = effect.family, effect.full_settings
    if family.direct is not None:
        return family.direct(_Own(scope, effect.label), value, driver, coefficients, settings)
    assert family.static is not None  # a form has one law or the other
    g = family.static(driver, coefficients, settings)
    return value + g if mode == "offset" else value * ca.exp(g)


def remembered(effect: Effect, scope: Any, driver: ca.SX) -> ca.SX:
    """What the law of an effect sees: its driver, or what states of its own make of it. Asked once for each effect."""
    family = effect.family
    if family.memory is None:
        return driver
    coefficients = {c.name: scope.parameter(effect.parameter(c.name)) for c in effect.terms}
    return family.memory(_Own(scope, effect.label), driver, coefficients, effect.full_settings)


@dataclass(frozen=True)
class _Own:
    """The states of one effect in the scope of its model."""

    scope: Any
    label: str

    def own_state(self, name: str) -> ca.SX:
        symbol: ca.SX = self.scope.state(f"{self.label}.{name}")
        return symbol

    def own_derivative(self, name: str, value: ca.SX, decay: ca.SX | None = None) -> None:
        self.scope.derivative(f"{self.label}.{name}", value, decay)
