"""A switch with two thresholds: on above the upper one, off below the lower one, and as it was between them.

The textbook's relay with hysteresis (Krasnosel'skii & Pokrovskii, *Systems with Hysteresis*, 1989, 1.1; a thermostat, a
Schmitt trigger, a float switch), as a flip-flop that is set and reset::

    dh/dt = (s((d - on) / w) (1 - h) - s((off - d) / w) h) / tau,   s(x) = 1 / (1 + exp(-x)),   g = off + (on - off) h

with the driver d, the state h between 0 and 1, the levels off (none in `relay`) and on, and w = EDGE (on_above -
off_below): between the thresholds it stays where it is.
"""

from __future__ import annotations

import casadi as ca

from adaptive_flot.greybox.forms.form import (
    Coefficient,
    CoefficientRole,
    Coefs,
    Form,
    FormKind,
    Settings,
    SiteScope,
    StaticLaw,
    fixed,
    number,
)

EDGE = 0.02
"""Rounding of each threshold, as a share of the distance between them: a fit has to see which way to move it."""
NO_BAND = 1e-9
"""Least distance between the thresholds, as a share of the size of the upper one: one threshold is a plain switch."""


def _logistic(x: ca.SX) -> ca.SX:
    value: ca.SX = (1 + ca.tanh(x / 2)) / 2
    return value


def _relay(m: SiteScope, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    on, off, tau = c["on_above"], c["off_below"], number(s, "follow_s")
    width = EDGE * ca.fabs(on - off) + NO_BAND * (ca.fabs(on) + 1e-9)
    rise, fall = _logistic((driver - on) / width), _logistic((off - driver) / width)
    h = m.own_state("on")
    m.own_derivative("on", (rise * (1 - h) - fall * h) / tau, decay=-(rise + fall) / tau)
    return h


def _size(h: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del s
    g: ca.SX = c["amplitude"] * h
    return g


def _two_levels(h: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del s
    g: ca.SX = c["off"] + (c["on"] - c["off"]) * h
    return g


def _relay_form(name: str, description: str, levels: tuple[Coefficient, ...], law: StaticLaw) -> Form:
    on = Coefficient("on_above", CoefficientRole.THRESHOLD, 1.0, scale=1.0, unit="driver")
    off = Coefficient("off_below", CoefficientRole.THRESHOLD, 0.0, scale=1.0, unit="driver")
    return Form(
        name,
        f"{description}, with two thresholds of the driver: on above the one, off below the other",
        FormKind.THRESHOLD,
        fixed(*levels, on, off),
        ("signal",),
        {"follow_s": 2.0},
        {"follow_s": "s"},
        static=law,
        memory=_relay,
        states=lambda settings: ("on",),
        abrupt=True,
    )


def _level(name: str) -> Coefficient:
    return Coefficient(name, CoefficientRole.LEVEL, unit="g")


_OFF, _ON = _level("off"), _level("on")
RELAY_FORMS = (
    _relay_form("relay", "a level while it is on, and none while it is off", (_level("amplitude"),), _size),
    _relay_form(
        "two_levels", "a level while it is off, and another while it is on", (_level("off"), _level("on")), _two_levels
    ),
)
"""Nothing, to the bit, while their levels are 0."""
