"""What a form of an effect is: the words of which each family of `forms` is made.

Two kinds. A *static* form gives a number g(driver); the site's value becomes `value exp(g)` (mode "factor") or
`value + g` (mode "offset"). A *direct* form transforms the value itself and may own states (lag, dead time, valve).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import casadi as ca
import numpy as np

from adaptive_flot.greybox.quantities import FloatArray

Settings = Mapping[str, float | tuple[float, ...]]

RELATIVE_UNITS = ("g", "value", "driver", "value/driver")
"""Units in terms of where an effect acts: `g` that of a static form's result (none for a factor, the site's for an
offset), `value` the site's unit, `driver` the driver's."""


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of a form: value at which the form does nothing, physical range, a change that matters, unit.

    `unit` is an SI unit or one of `RELATIVE_UNITS`, since a form knows neither its site nor its driver.
    """

    name: str
    default: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 0.1
    unit: str = "-"
    shape: bool = False
    """A shape coefficient (onset, time constant, threshold) alone does nothing; an amplitude switches the form on."""


class SiteScope(Protocol):
    """What a direct form may use while it is attached: its own states, prefixed by the effect's name."""

    def own_state(self, name: str) -> ca.SX:
        """Symbol of a state of this effect."""
        ...

    def own_derivative(self, name: str, value: ca.SX, decay: ca.SX | None = None) -> None:
        """Give its derivative [1/s times its unit]."""
        ...


Coefs = Mapping[str, ca.SX]
StaticLaw = Callable[[ca.SX, Coefs, Settings], ca.SX]
DirectLaw = Callable[[SiteScope, ca.SX, ca.SX, Coefs, Settings], ca.SX]


@dataclass(frozen=True)
class Form:
    """A family of effects.

    Attributes
    ----------
    name, description
        What it is called, and what it is in words.
    coefficients
        Its coefficients, from the settings.
    settings
        Fixed numbers it needs (reference, knots, stages), with their defaults; None where it must be given.
    setting_units
        Unit of each setting that has one, as in `Coefficient`.
    static, direct
        Its law, one of the two: `(driver, coefficients, settings) -> g` or
        `(scope, value, driver, coefficients, settings) -> value`.
    states
        Names of the states it owns, from the settings.
    drivers
        "constant", "time", "signal" (any quantity of the model), or a dynamic form's own name.
    """

    name: str
    description: str
    coefficients: Callable[[Settings], tuple[Coefficient, ...]]
    drivers: tuple[str, ...]
    settings: Mapping[str, float | tuple[float, ...] | None]
    setting_units: Mapping[str, str] = field(default_factory=dict)
    static: StaticLaw | None = None
    direct: DirectLaw | None = None
    states: Callable[[Settings], tuple[str, ...]] = lambda settings: ()


def number(settings: Settings, name: str) -> float:
    """One number of the settings."""
    value = settings[name]
    return float(value[0] if isinstance(value, tuple) else value)


def numbers(settings: Settings, name: str) -> FloatArray:
    """Several numbers of the settings (n,)."""
    return np.atleast_1d(np.asarray(settings[name], dtype=float))


def wrong_setting(name: str, value: float | tuple[float, ...]) -> str | None:
    """What is wrong with a setting, None if nothing: knots rise, stages are counted, all others are positive."""
    several = np.atleast_1d(np.asarray(value, dtype=float))
    if not np.isfinite(several).all():
        return "give finite numbers"
    if name == "knots":
        return None if several.size >= 2 and (np.diff(several) > 0).all() else "give two or more numbers that rise"
    if several.size != 1 or not several[0] > 0:
        return "give one positive number"
    return "give a whole number" if name == "stages" and several[0] % 1 else None


SHARE = Coefficient("amplitude", 0.0, 0.0, 1.0, 1.0)
"""Share of the way from the value as it was (0) to the value transformed (1)."""


def fixed(*coefficients: Coefficient) -> Callable[[Settings], tuple[Coefficient, ...]]:
    """Coefficients that no setting changes."""
    return lambda settings: coefficients


def softplus(x: ca.SX, width: float | ca.SX) -> ca.SX:
    """Smooth max(x, 0): width log(1 + exp(x / width)), without overflow."""
    positive: ca.SX = ca.fmax(x, 0) + width * ca.log1p(ca.exp(-ca.fabs(x) / width))
    return positive
