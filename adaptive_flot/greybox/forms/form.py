"""What a form of an effect is: the terms in which each family of `forms` is declared.

Two kinds of law. A *static* form gives a number g(driver); the site's value becomes `value exp(g)` (mode "factor") or
`value + g` (mode "offset"). A *direct* form transforms the value itself and may own states (lag, dead time, valve).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, unique
from typing import Protocol

import casadi as ca
import numpy as np

from adaptive_flot.greybox.quantities import FloatArray

Settings = Mapping[str, float | tuple[float, ...]]

RELATIVE_UNITS = ("g", "value", "driver", "value/driver")
"""Units in terms of where an effect acts: `g` that of a static form's result (none for a factor, the site's for an
offset), `value` the site's unit, `driver` the driver's."""


@unique
class CoefficientRole(Enum):
    """What a coefficient does in its form; the value says it in words."""

    LEVEL = "size of the change at the site, or its constant part"
    KNOT_VALUE = "value of a curve at one of its knots"
    SLOPE = "how much the change grows with the driver"
    GAIN = "how much the change grows with what the driver exceeds a threshold by"
    BLEND = "fraction of the way from the value as it was (0) to the value transformed (1)"
    ONSET = "time at which an event begins"
    DURATION = "time that an event takes"
    TIME_CONSTANT = "time constant of an exponential approach or of a first-order lag"
    DEAD_TIME = "time by which the value is delayed"
    READING = "time at which the value is read, and kept until it is read again"
    THRESHOLD = "value of the driver at which something begins"
    LIMIT = "value that can not be passed"
    BAND = "half the width of a dead band"
    REST = "what is left of the way when a part has jumped"
    FLOOR = "value that is not gone below"
    POSITION = "value at which a part stays"
    OFFSET = "what is added to the value"
    PERIOD = "time after which a disturbance repeats itself"
    PHASE = "time at which a part of a period begins"


_AMPLITUDES = frozenset(
    {
        CoefficientRole.LEVEL,
        CoefficientRole.KNOT_VALUE,
        CoefficientRole.SLOPE,
        CoefficientRole.GAIN,
        CoefficientRole.BLEND,
        CoefficientRole.OFFSET,
    }
)


@unique
class FormKind(Enum):
    """What kind of dependence a form describes; the value says it in words."""

    CONSTANT = "the same change always"
    LINE = "a line in the driver or its logarithm, or a polynomial, with a free constant"
    CURVE = "a spline in the driver whose shape is free"
    TURN = "a change that turns with the sign of the driver"
    THRESHOLD = "something begins where the driver exceeds a threshold"
    PROPORTIONAL = "a change in proportion to the driver"
    EVENT = "something begins at a time"
    LIMIT = "the value can not pass a limit"
    FAULT = "a part does something else than is asked of it"
    CALIBRATION = "an instrument shows a fixed function of the value"
    PERIODIC = "a change that repeats itself in time"
    MEMORY = "the value answers to its own past"


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of a form.

    Attributes
    ----------
    name
        Name in files and of the parameter.
    role
        What it does in the form.
    default
        Value where it is not given: that of an amplitude makes the form do nothing.
    lower, upper
        Physical range, in the unit.
    scale
        Size of a change that matters, in the unit.
    unit
        An SI unit or one of `RELATIVE_UNITS`, since a form knows neither its site nor its driver.
    """

    name: str
    role: CoefficientRole
    default: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    scale: float = 0.1
    unit: str = "-"

    @property
    def is_level(self) -> bool:
        """Whether it is a change at the site itself: a level, or the value of a curve at a knot."""
        return self.role in (CoefficientRole.LEVEL, CoefficientRole.KNOT_VALUE)

    @property
    def is_shape(self) -> bool:
        """Whether it only shapes the form (onset, time constant, threshold): alone it does nothing."""
        return self.role not in _AMPLITUDES


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
MemoryLaw = Callable[[SiteScope, ca.SX, Coefs, Settings], ca.SX]


@dataclass(frozen=True)
class Form:
    """A family of effects.

    Attributes
    ----------
    name, description
        What it is called, and what it is in words.
    kind
        What kind of dependence it describes.
    coefficients
        Its coefficients, from the settings.
    settings
        Fixed numbers it needs (reference, knots, stages), with their defaults; None where it must be given.
    setting_units
        Unit of each setting that has one, as in `Coefficient`.
    static, direct
        Its law, one of the two: `(driver, coefficients, settings) -> g` or
        `(scope, value, driver, coefficients, settings) -> value`.
    memory
        What a static law sees in place of its driver, by states of the form: `(scope, driver, coefficients, settings)`.
    states
        Names of the states it owns, from the settings.
    drivers
        "constant", "time", "signal" (any quantity of the model), or a dynamic form's own name.
    abrupt
        Whether its effect may change much within seconds, so that a coarse grid of times would miss it.
    passes
        Whether an event is over after its duration: the value is then where it would have been without it.
    is_beside
        Whether it is a flow of its own beside the value: what other effects do to the value does not touch it.
    jumps
        Whether a state of its own moves at once: its decay rate is then far larger than one over the step.
    """

    name: str
    description: str
    kind: FormKind
    coefficients: Callable[[Settings], tuple[Coefficient, ...]]
    drivers: tuple[str, ...]
    settings: Mapping[str, float | tuple[float, ...] | None]
    setting_units: Mapping[str, str] = field(default_factory=dict)
    static: StaticLaw | None = None
    direct: DirectLaw | None = None
    memory: MemoryLaw | None = None
    states: Callable[[Settings], tuple[str, ...]] = lambda settings: ()
    abrupt: bool = False
    passes: bool = False
    is_beside: bool = False
    jumps: bool = False

    @property
    def is_constant(self) -> bool:
        """Whether it is the same change always."""
        return self.kind is FormKind.CONSTANT

    @property
    def is_curve(self) -> bool:
        """Whether it is a spline whose shape is free."""
        return self.kind is FormKind.CURVE

    @property
    def turns(self) -> bool:
        """Whether it turns with the sign of its driver."""
        return self.kind is FormKind.TURN

    @property
    def is_event(self) -> bool:
        """Whether something begins at a time, its onset."""
        return self.kind is FormKind.EVENT

    @property
    def is_linear(self) -> bool:
        """Whether the law is linear in all coefficients."""
        return self.kind in (
            FormKind.CONSTANT,
            FormKind.LINE,
            FormKind.CURVE,
            FormKind.PROPORTIONAL,
            FormKind.CALIBRATION,
        )

    @property
    def has_memory(self) -> bool:
        """Whether the value answers to its own past, by states of the form."""
        return self.kind is FormKind.MEMORY or self.memory is not None


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
    if name == "middle":
        return None if several.size == 1 else "give one number"
    if name == "knots":
        return None if several.size >= 2 and (np.diff(several) > 0).all() else "give two or more numbers that rise"
    if several.size != 1 or not several[0] > 0:
        return "give one positive number"
    if name == "sides":
        return None if several[0] in (1, 2, 3) else "give 1 (level below), 2 (level above) or 3 (both)"
    return "give a whole number" if name in ("stages", "count") and several[0] % 1 else None


SHORTEST = 1e-6
"""Least time constant, dead time, duration or period [s]: a search sets its own by the sampling interval."""
BLEND = Coefficient("amplitude", CoefficientRole.BLEND, 0.0, 0.0, 1.0, 1.0)
"""Fraction of the way from the value as it was (0) to the value transformed (1)."""


def fixed(*coefficients: Coefficient) -> Callable[[Settings], tuple[Coefficient, ...]]:
    """Coefficients that no setting changes."""
    return lambda settings: coefficients


def softplus(x: ca.SX, width: float | ca.SX) -> ca.SX:
    """Smooth max(x, 0): width log(1 + exp(x / width)), without overflow."""
    positive: ca.SX = ca.fmax(x, 0) + width * ca.log1p(ca.exp(-ca.fabs(x) / width))
    return positive
