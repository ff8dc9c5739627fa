"""Forms of what people and wear do to a plant: parts that stick or leak, switches, instruments that do not see a sign.

The value at the site is v. Every form is nothing, to the bit, while its amplitude is 0.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox.forms.form import (
    BLEND,
    SHORTEST,
    Coefficient,
    CoefficientRole,
    Coefs,
    Form,
    FormKind,
    Settings,
    SiteScope,
    fixed,
    number,
    softplus,
)


def _stuck(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + a (level - v)."""
    del m, driver, s
    return value + c["amplitude"] * (c["level"] - value)


def _stuck_while(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + a q (level - v), q = 1 from `on_1` on for `for_1`, else 0, its edges rounded over `width`."""
    del m
    width = number(s, "width")
    begun, over = (1 + ca.tanh((driver - t) / (2 * width)) for t in (c["on_1"], c["on_1"] + c["for_1"]))
    return value + c["amplitude"] * (begun - over) / 2 * (c["level"] - value)


def _leak(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + a (max(v, level) - v), the maximum rounded over `width`."""
    del m, driver
    return value + c["amplitude"] * softplus(c["level"] - value, number(s, "width"))


def _rectified(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + a (|v| - v), the absolute value rounded over `width`."""
    del m, driver
    return value + c["amplitude"] * (ca.sqrt(value**2 + number(s, "width") ** 2) - value)


def _span(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + offset + slope (v - middle): a calibration error, the same in any unit with any zero."""
    del m, driver
    return value + c["offset"] + c["slope"] * (value - number(s, "middle"))


def _dead_zone(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V less what of it lies within +- `half_width` of `centre`: inside the zone the value stays at the centre."""
    del m, driver, s
    away = value - c["centre"]
    return value - c["amplitude"] * ca.fmin(ca.fmax(away, -c["half_width"]), c["half_width"])


def _switch(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """A times the number of intervals [on_k, on_k + for_k] that hold the time, their edges rounded over `width`."""
    width = number(s, "width")

    def after(onset: ca.SX) -> ca.SX:
        return (1 + ca.tanh((driver - onset) / (2 * width))) / 2

    count = int(number(s, "count"))
    inside = sum(after(c[f"on_{k}"]) - after(c[f"on_{k}"] + c[f"for_{k}"]) for k in range(1, count + 1))
    g: ca.SX = c["amplitude"] * inside
    return g


def _switch_coefficients(settings: Settings) -> tuple[Coefficient, ...]:
    count = int(number(settings, "count"))
    edges: list[Coefficient] = []
    for k in range(1, count + 1):
        edges.append(Coefficient(f"on_{k}", CoefficientRole.ONSET, 0.0, scale=60.0, unit="s"))
        edges.append(Coefficient(f"for_{k}", CoefficientRole.DURATION, 3600.0, 0.0, scale=60.0, unit="s"))
    return (Coefficient("amplitude", CoefficientRole.LEVEL, unit="g"), *edges)


def _periodic(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """Sum of ``sine sin(2 pi t / period)`` and ``cosine cos(2 pi t / period)``."""
    del s
    angle = 2 * np.pi * driver / c["period"]
    return c["sine"] * ca.sin(angle) + c["cosine"] * ca.cos(angle)


def _cycle(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """A q, q = 1 for `duration` from `onset` on in every `period`, else 0, its edges rounded over `width`.

    The cosine of the phase about the middle is above that of the edges while it is on: smooth, and periodic.
    """
    turn, half = 2 * np.pi / c["period"], c["duration"] / 2
    edge = turn * half
    away = ca.cos(turn * (driver - c["onset"] - half)) - ca.cos(edge)
    slope = ca.fmax(turn * ca.sin(edge), 1e-9)  # of the cosine at the edges, so that `away` is in seconds there
    g: ca.SX = c["amplitude"] * (1 + ca.tanh(away / slope / (2 * number(s, "width")))) / 2
    return g


def _store(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """V + exchange (x - h), dh/dt = (x - h) / tau: a store h that exchanges with the state x of the balance."""
    del s
    h = m.own_state("store")
    m.own_derivative("store", (driver - h) / c["time_constant"])
    return value + c["exchange"] * (driver - h)


FAULT_FORMS: tuple[Form, ...] = (
    Form(
        "stuck",
        "the value stays where it is, whatever is asked",
        FormKind.FAULT,
        fixed(BLEND, Coefficient("level", CoefficientRole.POSITION, 0.0, scale=1.0, unit="value")),
        ("own_value",),
        {},
        direct=_stuck,
    ),
    Form(
        "stuck_while",
        "the value stays where it is for a time, whatever is asked",
        FormKind.EVENT,
        fixed(
            BLEND,
            Coefficient("level", CoefficientRole.POSITION, 0.0, scale=1.0, unit="value"),
            Coefficient("on_1", CoefficientRole.ONSET, 0.0, scale=60.0, unit="s"),
            Coefficient("for_1", CoefficientRole.DURATION, 3600.0, 0.0, scale=60.0, unit="s"),
        ),
        ("time",),
        {"width": 2.0},
        {"width": "s"},
        direct=_stuck_while,
        abrupt=True,
        passes=True,
    ),
    Form(
        "leak",
        "the value does not go below a level",
        FormKind.FAULT,
        fixed(BLEND, Coefficient("level", CoefficientRole.FLOOR, 0.0, scale=1.0, unit="value")),
        ("own_value",),
        {"width": 0.01},
        {"width": "value"},
        direct=_leak,
    ),
    Form(
        "rectified",
        "the sign of the value is not seen",
        FormKind.CALIBRATION,
        fixed(BLEND),
        ("own_value",),
        {"width": 0.01},
        {"width": "value"},
        direct=_rectified,
    ),
    Form(
        "span",
        "a calibration error: an offset and a wrong span",
        FormKind.CALIBRATION,
        fixed(
            Coefficient("offset", CoefficientRole.OFFSET, unit="value", scale=1.0),
            Coefficient("slope", CoefficientRole.SLOPE, 0.0, -2.0),
        ),
        ("own_value",),
        {"middle": None},
        {"middle": "value"},
        direct=_span,
    ),
    Form(
        "dead_zone",
        "the value does not leave the middle of a zone before what is asked does",
        FormKind.FAULT,
        fixed(
            BLEND,
            Coefficient("centre", CoefficientRole.POSITION, 0.0, scale=1.0, unit="value"),
            Coefficient("half_width", CoefficientRole.BAND, 0.0, 0.0, scale=1.0, unit="value"),
        ),
        ("own_value",),
        {},
        direct=_dead_zone,
    ),
    Form(
        "switch",
        "two levels, switched on and off at times",
        FormKind.EVENT,
        _switch_coefficients,
        ("time",),
        {"count": 1.0, "width": 2.0},
        {"width": "s"},
        static=_switch,
        abrupt=True,
        passes=True,
    ),
    Form(
        "periodic",
        "a sine of time",
        FormKind.PERIODIC,
        fixed(
            Coefficient("sine", CoefficientRole.LEVEL, unit="g"),
            Coefficient("cosine", CoefficientRole.LEVEL, unit="g"),
            Coefficient("period", CoefficientRole.PERIOD, 60.0, SHORTEST, scale=10.0, unit="s"),
        ),
        ("time",),
        {},
        static=_periodic,
    ),
    Form(
        "cycle",
        "two levels, switched on and off in every period",
        FormKind.PERIODIC,
        fixed(
            Coefficient("amplitude", CoefficientRole.LEVEL, unit="g"),
            Coefficient("onset", CoefficientRole.PHASE, 0.0, scale=60.0, unit="s"),
            Coefficient("duration", CoefficientRole.DURATION, 30.0, SHORTEST, scale=60.0, unit="s"),
            Coefficient("period", CoefficientRole.PERIOD, 60.0, SHORTEST, scale=10.0, unit="s"),
        ),
        ("time",),
        {"width": 2.0},
        {"width": "s"},
        static=_cycle,
        abrupt=True,
    ),
    Form(
        "store",
        "a second store behind a balance, that exchanges with it",
        FormKind.MEMORY,
        fixed(
            Coefficient("exchange", CoefficientRole.SLOPE, 0.0, 0.0, scale=0.1, unit="value/driver"),
            Coefficient("time_constant", CoefficientRole.TIME_CONSTANT, 600.0, SHORTEST, scale=300.0, unit="s"),
        ),
        ("signal",),
        {},
        direct=_store,
        states=lambda settings: ("store",),
        is_beside=True,
    ),
)
"""Parts that stick or leak, switches, periodic disturbances, hidden stores, signs that are not seen."""
