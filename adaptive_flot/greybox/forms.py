"""Forms of an effect: how a quantity at a site answers to its driver.

Each form is a *family* whose shape is free (its coefficients), and each is nothing at its default coefficients:
`exp(0) = 1` and `+ 0` are exact, so a model with an effect of amplitude zero is the nominal model to the bit.

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


# -- static forms ------------------------------------------------------------------------------------------------------

LEAST_SHARE = 1e-6
"""A driver of a power law is taken as at least this share of its reference: keeps the logarithm finite."""


def _shift(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver, s
    return c["amplitude"]


def _power(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["amplitude"] + c["exponent"] * ca.log(ca.fmax(driver / reference, LEAST_SHARE))


def _linear(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["amplitude"] + c["slope"] * (driver / reference - 1)


def _step(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    # a logistic function, written so that it and its slope stay finite far from the onset
    return c["amplitude"] * (1 + ca.tanh((driver - c["onset"]) / (2 * number(s, "width")))) / 2


def _ramp(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del s
    span = ca.fmax(c["duration"], 1e-9)
    return c["amplitude"] * ca.fmin(ca.fmax((driver - c["onset"]) / span, 0), 1)


def _washout(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del s
    since = ca.fmax(driver - c["onset"], 0)
    return c["amplitude"] * (1 - ca.exp(-since / c["time_constant"]))


def _curve(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    knots = numbers(s, "knots")
    basis = ca.vertcat(*spline_basis(driver, knots))
    values = ca.vertcat(*(c[f"value_{k + 1}"] for k in range(len(knots))))
    g: ca.SX = ca.dot(values, basis)
    return g


def spline_basis(x: ca.SX, knots: FloatArray) -> list[ca.SX]:
    """Cardinal natural cubic splines: entry k is 1 at knot k and 0 at the others, straight lines outside.

    Hastie, Tibshirani & Friedman, *The Elements of Statistical Learning*, 2nd ed., (5.4) and (5.5). The driver is
    scaled to the span of the knots first.
    """
    low, span = knots[0], knots[-1] - knots[0]
    s = (x - low) / span
    at = (knots - low) / span

    def raw(v: ca.SX | float) -> list[ca.SX]:
        def d(k: int) -> ca.SX:
            cubic: ca.SX = (ca.fmax(v - at[k], 0) ** 3 - ca.fmax(v - at[-1], 0) ** 3) / (at[-1] - at[k])
            return cubic

        return [ca.SX(1), ca.SX(v), *(d(k) - d(len(at) - 2) for k in range(len(at) - 2))]

    values = np.array([[float(b) for b in raw(float(a))] for a in at])
    inverse: FloatArray = np.linalg.inv(values)
    terms = raw(s)
    return [
        sum((terms[i] * inverse[i, k] for i in range(1, len(at))), terms[0] * inverse[0, k]) for k in range(len(at))
    ]


def _hinge(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["slope"] * _softplus((driver - c["threshold"]) / reference, number(s, "width"))


def _softplus(x: ca.SX, width: float | ca.SX) -> ca.SX:
    """Smooth max(x, 0): width log(1 + exp(x / width)), without overflow."""
    positive: ca.SX = ca.fmax(x, 0) + width * ca.log1p(ca.exp(-ca.fabs(x) / width))
    return positive


# -- direct forms ------------------------------------------------------------------------------------------------------


def _overflow(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m
    return value + c["slope"] * driver + c["gain"] * _softplus(driver - c["threshold"], number(s, "width"))


def _extra_linear(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m, s
    return value + c["slope"] * driver


def _clip(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m, driver
    over = _softplus(value - c["limit"], number(s, "width"))
    return value - c["amplitude"] * over


def _lag(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver
    scale, tau = number(s, "scale"), c["time_constant"]
    x = m.own_state("lagged")
    m.own_derivative("lagged", (value / scale - x) / tau, decay=-1 / tau)
    return value + c["amplitude"] * (x * scale - value)


def _lags(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver
    scale = number(s, "scale")
    x = value / scale
    for name, tau in (("lagged_1", c["time_constant"]), ("lagged_2", c["time_constant_2"])):
        state = m.own_state(name)
        m.own_derivative(name, (x - state) / tau, decay=-1 / tau)
        x = state
    return value + c["amplitude"] * (x * scale - value)


def _delay(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver
    scale, stages = number(s, "scale"), int(number(s, "stages"))
    tau = c["dead_time"] / stages
    x = value / scale
    for k in range(stages):
        name = f"stage_{k + 1}"
        state = m.own_state(name)
        m.own_derivative(name, (x - state) / tau, decay=-1 / tau)
        x = state
    return value + c["amplitude"] * (x * scale - value)


BAND_CORNER = 0.05
"""Corners of a dead band are rounded over this share of it: past sharp ones an optimiser finds no way (ipopt and fatrop
give up on the air valve). Half way out of the band the position then creeps by 1e-6 of the band a second."""


def _stiction(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver
    scale, follow = number(s, "scale"), number(s, "follow_s")
    x = m.own_state("position")
    error = value / scale - x
    band = c["band"] / scale
    width = BAND_CORNER * (band + 1e-9)
    moved = _softplus(error - band, width) - _softplus(-error - band, width)
    m.own_derivative("position", moved / follow)
    return value + c["amplitude"] * (x * scale - value)


def _fixed(*coefficients: Coefficient) -> Callable[[Settings], tuple[Coefficient, ...]]:
    return lambda settings: coefficients


def _curve_coefficients(settings: Settings) -> tuple[Coefficient, ...]:
    return tuple(Coefficient(f"value_{k + 1}", unit="g") for k in range(len(numbers(settings, "knots"))))


def _delay_states(settings: Settings) -> tuple[str, ...]:
    return tuple(f"stage_{k + 1}" for k in range(int(number(settings, "stages"))))


_AMPLITUDE = Coefficient("amplitude", unit="g")
_SHARE = Coefficient("amplitude", 0.0, 0.0, 1.0, 1.0)
_ONSET = Coefficient("onset", 0.0, scale=60.0, unit="s", shape=True)

FORMS: Mapping[str, Form] = {
    form.name: form
    for form in (
        Form("shift", "constant factor or offset", _fixed(_AMPLITUDE), ("constant",), {}, static=_shift),
        Form(
            "power",
            "power law in the driver, with a free constant",
            _fixed(_AMPLITUDE, Coefficient("exponent", 0.0, -10.0, 10.0, unit="g")),
            ("signal",),
            {"reference": None},
            {"reference": "driver"},
            static=_power,
        ),
        Form(
            "linear",
            "straight line in the driver, with a free constant",
            _fixed(_AMPLITUDE, Coefficient("slope", unit="g")),
            ("signal",),
            {"reference": None},
            {"reference": "driver"},
            static=_linear,
        ),
        Form(
            "curve",
            "natural cubic spline of free shape",
            _curve_coefficients,
            ("signal", "time"),
            {"knots": None},
            {"knots": "driver"},
            static=_curve,
        ),
        Form(
            "hinge",
            "nothing below a threshold of the driver, a straight line above",
            _fixed(Coefficient("slope", unit="g"), Coefficient("threshold", 0.0, unit="driver", shape=True)),
            ("signal",),
            {"reference": None, "width": 0.02},
            {"reference": "driver"},
            static=_hinge,
        ),
        Form(
            "step",
            "a step at an onset",
            _fixed(_AMPLITUDE, _ONSET),
            ("time",),
            {"width": 2.0},
            {"width": "s"},
            static=_step,
        ),
        Form(
            "ramp",
            "a ramp from an onset, then constant",
            _fixed(_AMPLITUDE, _ONSET, Coefficient("duration", 600.0, 1.0, scale=100.0, unit="s", shape=True)),
            ("time",),
            {},
            static=_ramp,
        ),
        Form(
            "washout",
            "an exponential approach from an onset, as a reagent that is washed out",
            _fixed(_AMPLITUDE, _ONSET, Coefficient("time_constant", 300.0, 1.0, scale=100.0, unit="s", shape=True)),
            ("time",),
            {},
            static=_washout,
        ),
        Form(
            "overflow",
            "a further flow in proportion to the driver, and what stands above a threshold of it spills",
            _fixed(
                Coefficient("slope", unit="value/driver", scale=0.01),
                Coefficient("gain", 0.0, 0.0, scale=0.1, unit="value/driver"),
                Coefficient("threshold", 0.0, scale=1.0, unit="driver", shape=True),
            ),
            ("signal",),
            {"width": 0.05},
            {"width": "driver"},
            direct=_overflow,
        ),
        Form(
            "proportional",
            "a further flow in proportion to the driver",
            _fixed(Coefficient("slope", unit="value/driver", scale=0.01)),
            ("signal",),
            {},
            direct=_extra_linear,
        ),
        Form(
            "saturation",
            "the value can not pass a limit",
            _fixed(_SHARE, Coefficient("limit", 0.0, scale=1.0, unit="value", shape=True)),
            ("saturation",),
            {"width": 0.01},
            {"width": "value"},
            direct=_clip,
        ),
        Form(
            "lag",
            "first-order lag",
            _fixed(_SHARE, Coefficient("time_constant", 30.0, 1.0, scale=10.0, unit="s", shape=True)),
            ("lag",),
            {"scale": None},
            {"scale": "value"},
            direct=_lag,
            states=lambda settings: ("lagged",),
        ),
        Form(
            "lags",
            "two first-order lags in a row",
            _fixed(
                _SHARE,
                Coefficient("time_constant", 20.0, 1.0, scale=10.0, unit="s", shape=True),
                Coefficient("time_constant_2", 10.0, 1.0, scale=10.0, unit="s", shape=True),
            ),
            ("lag",),
            {"scale": None},
            {"scale": "value"},
            direct=_lags,
            states=lambda settings: ("lagged_1", "lagged_2"),
        ),
        Form(
            "delay",
            "dead time, as a chain of equal lags",
            _fixed(_SHARE, Coefficient("dead_time", 30.0, 2.0, scale=10.0, unit="s", shape=True)),
            ("delay",),
            {"scale": None, "stages": 12.0},
            {"scale": "value"},
            direct=_delay,
            states=_delay_states,
        ),
        Form(
            "stiction",
            "the value follows only when the demand leaves a band",
            _fixed(_SHARE, Coefficient("band", 0.0, 0.0, unit="value", shape=True)),
            ("lag",),
            {"scale": None, "follow_s": 2.0},
            {"scale": "value", "follow_s": "s"},
            direct=_stiction,
            states=lambda settings: ("position",),
        ),
    )
}
