"""Direct forms without a memory: the value itself is changed, a flow joined or cut off."""

from __future__ import annotations

import casadi as ca

from adaptive_flot.greybox.forms.form import (
    BLEND,
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


def _overflow(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m
    return value + c["slope"] * driver + c["gain"] * softplus(driver - c["threshold"], number(s, "width"))


def _extra_linear(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m, s
    return value + c["slope"] * driver


def _clip(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del m, driver
    over = softplus(value - c["limit"], number(s, "width"))
    return value - c["amplitude"] * over


DIRECT_FORMS: tuple[Form, ...] = (
    Form(
        "overflow",
        "a further flow in proportion to the driver, and what stands above a threshold of it spills",
        FormKind.THRESHOLD,
        fixed(
            Coefficient("slope", CoefficientRole.SLOPE, unit="value/driver", scale=0.01),
            Coefficient("gain", CoefficientRole.GAIN, 0.0, 0.0, scale=0.1, unit="value/driver"),
            Coefficient("threshold", CoefficientRole.THRESHOLD, 0.0, scale=1.0, unit="driver"),
        ),
        ("signal",),
        {"width": 0.05},
        {"width": "driver"},
        direct=_overflow,
    ),
    Form(
        "proportional",
        "a further flow in proportion to the driver",
        FormKind.PROPORTIONAL,
        fixed(Coefficient("slope", CoefficientRole.SLOPE, unit="value/driver", scale=0.01)),
        ("signal",),
        {},
        direct=_extra_linear,
    ),
    Form(
        "saturation",
        "the value can not pass a limit",
        FormKind.LIMIT,
        fixed(BLEND, Coefficient("limit", CoefficientRole.LIMIT, 0.0, scale=1.0, unit="value")),
        ("saturation",),
        {"width": 0.01},
        {"width": "value"},
        direct=_clip,
    ),
)
"""Further flows and limits."""
