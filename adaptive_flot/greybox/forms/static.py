"""Static forms: a number g(driver), nothing of the past."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from adaptive_flot.greybox.forms.form import (
    SHORTEST,
    Coefficient,
    CoefficientRole,
    Coefs,
    Form,
    FormKind,
    Settings,
    StaticLaw,
    fixed,
    number,
    numbers,
    softplus,
)
from adaptive_flot.greybox.quantities import FloatArray

SHARPEST = 0.3
"""Least width over which a change turns with the sign of its driver, in scales of it: a jump has no derivative."""
WIDEST = 10.0
"""Largest such width, likewise: what changes over more of the driver's range does not turn with its sign."""
LEAST_SPAN = 1e-3
"""Least distance from the begin of a limited line to its end, as a share of that between its knots."""
ONE_BELOW, ONE_ABOVE, BOTH_SIDES = 1, 2, 3
"""Where a limited line is level: below its begin, above its end, or on both sides."""
LEAST_BLEND = 1e-6
"""A driver of a power law is taken as at least this share of its reference: keeps the logarithm finite."""


def _shift(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del driver, s
    return c["amplitude"]


def _power(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["amplitude"] + c["exponent"] * ca.log(ca.fmax(driver / reference, LEAST_BLEND))


def _linear(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["amplitude"] + c["slope"] * (driver / reference - 1)


def _cubic(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    knots = numbers(s, "knots")
    low, high = knots[0], knots[-1]
    z = (2 * driver - low - high) / (high - low)
    g: ca.SX = c["amplitude"] + z * (c["slope"] + z * (c["square"] + z * c["cube"]))
    return g


def _direction(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    del s
    return c["amplitude"] + c["turn"] * ca.tanh(driver / c["width"])


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


def _polyline(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    # hats: 1 at the own knot, 0 at all others, straight between; before the first and after the last it stays level
    knots = numbers(s, "knots")
    x = ca.fmin(ca.fmax(driver, knots[0]), knots[-1])
    rising = [1.0, *((x - a) / (b - a) for a, b in pairwise(knots))]
    falling = [*((b - x) / (b - a) for a, b in pairwise(knots)), 1.0]
    hats = (ca.fmax(ca.fmin(up, down), 0.0) for up, down in zip(rising, falling, strict=True))
    g: ca.SX = sum((c[f"value_{k + 1}"] * hat for k, hat in enumerate(hats)), ca.SX(0))
    return g


def spline_basis(x: ca.SX, knots: FloatArray) -> list[ca.SX]:
    """Cardinal natural cubic splines: entry k is 1 at knot k and 0 at the others, straight lines outside.

    Hastie, Tibshirani & Friedman, *The Elements of Statistical Learning*, 2nd ed., (5.4) and (5.5). The driver is
    scaled to the span of the knots first.
    """
    at, inverse = _scaled_knots(knots)
    s = (x - knots[0]) / (knots[-1] - knots[0])
    terms = _powers(s, at, [ca.fmax(s - b, 0) ** 3 for b in at])
    return list(ca.vertsplit(ca.mtimes(ca.DM(inverse.T), ca.vertcat(*terms))))


def spline_numbers(x: FloatArray, knots: FloatArray) -> FloatArray:
    """The same splines (N, knots) at the numbers x (N,)."""
    at, inverse = _scaled_knots(knots)
    s = (x - knots[0]) / (knots[-1] - knots[0])
    above = [np.maximum(s - b, 0.0) for b in at]
    terms = _powers(s, at, [a * a * a for a in above])
    table: FloatArray = np.column_stack([np.ones(len(s)), *terms[1:]]) @ inverse
    return table


def _scaled_knots(knots: FloatArray) -> tuple[list[float], FloatArray]:
    """Knots from 0 to 1, and the inverse of the basis of truncated powers at them."""
    at = [float(a) for a in (knots - knots[0]) / (knots[-1] - knots[0])]
    values = np.array([_powers(a, at, [max(a - b, 0.0) ** 3 for b in at]) for a in at])
    return at, np.linalg.inv(values)


def _powers(v: Any, at: Sequence[float], cubes: Sequence[Any]) -> list[Any]:
    """The basis of truncated powers at v, a number or a symbol, with the cubes of what v is above each knot."""
    d = [(cube - cubes[-1]) / (at[-1] - knot) for cube, knot in zip(cubes[:-1], at[:-1], strict=True)]
    return [1.0, v, *(each - d[-1] for each in d[:-1])]


def _hinge(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    reference = number(s, "reference")
    return c["slope"] * softplus((driver - c["threshold"]) / reference, number(s, "width"))


def _limited_line(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    g: ca.SX = c["amplitude"] + c["slope"] * (_limited_share(driver, c, s) - 0.5)
    return g


def _limited_factor(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    # straight is the factor, and not its logarithm
    z = _limited_share(driver, c, s)
    low, high = c["amplitude"] - c["slope"] / 2, c["amplitude"] + c["slope"] / 2
    g: ca.SX = low + ca.log1p(z * ca.expm1(high - low))
    return g


def _limited_share(driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """How far the driver is from the begin to the end, from 0 to 1; a side without one ends at its knot."""
    low, high = _ends(s)
    begins, ends = c.get("begins", ca.SX(low)), c.get("ends", ca.SX(high))
    span = ca.fmax(ends - begins, LEAST_SPAN * (high - low))
    share: ca.SX = ca.fmin(ca.fmax((driver - begins) / span, 0), 1)
    return share


def _ends(settings: Settings) -> tuple[float, float]:
    knots = numbers(settings, "knots")
    return float(knots[0]), float(knots[-1])


def _limited_line_coefficients(settings: Settings) -> tuple[Coefficient, ...]:
    low, high = _ends(settings)
    span = high - low
    begins = Coefficient("begins", CoefficientRole.THRESHOLD, low, low, high, 0.1 * span, unit="driver")
    ends = Coefficient("ends", CoefficientRole.THRESHOLD, high, low, high, 0.1 * span, unit="driver")
    sides = {ONE_BELOW: (begins,), ONE_ABOVE: (ends,), BOTH_SIDES: (begins, ends)}
    chosen = sides[round(number(settings, "sides"))]
    return _AMPLITUDE, Coefficient("slope", CoefficientRole.SLOPE, unit="g"), *chosen


def _curve_coefficients(settings: Settings) -> tuple[Coefficient, ...]:
    return tuple(
        Coefficient(f"value_{k + 1}", CoefficientRole.KNOT_VALUE, unit="g")
        for k in range(len(numbers(settings, "knots")))
    )


def _direction_coefficients(settings: Settings) -> tuple[Coefficient, ...]:
    scale = number(settings, "scale")
    width = Coefficient("width", CoefficientRole.BAND, scale, SHARPEST * scale, WIDEST * scale, scale, unit="driver")
    return _AMPLITUDE, Coefficient("turn", CoefficientRole.SLOPE, unit="g"), width


def _limited(name: str, description: str, law: StaticLaw) -> Form:
    return Form(
        name,
        description,
        FormKind.THRESHOLD,
        _limited_line_coefficients,
        ("signal",),
        {"knots": None, "sides": float(BOTH_SIDES)},
        {"knots": "driver"},
        static=law,
    )


_AMPLITUDE = Coefficient("amplitude", CoefficientRole.LEVEL, unit="g")
_ONSET = Coefficient("onset", CoefficientRole.ONSET, 0.0, scale=60.0, unit="s")

STATIC_FORMS: tuple[Form, ...] = (
    Form("shift", "constant factor or offset", FormKind.CONSTANT, fixed(_AMPLITUDE), ("constant",), {}, static=_shift),
    Form(
        "power",
        "power law in the driver, with a free constant",
        FormKind.LINE,
        fixed(_AMPLITUDE, Coefficient("exponent", CoefficientRole.SLOPE, 0.0, -10.0, 10.0, unit="g")),
        ("signal",),
        {"reference": None},
        {"reference": "driver"},
        static=_power,
    ),
    Form(
        "linear",
        "straight line in the driver, with a free constant",
        FormKind.LINE,
        fixed(_AMPLITUDE, Coefficient("slope", CoefficientRole.SLOPE, unit="g")),
        ("signal",),
        {"reference": None},
        {"reference": "driver"},
        static=_linear,
    ),
    Form(
        "cubic",
        "polynomial of third degree in the driver, from -1 to 1 between two knots, as of a spring that hardens",
        FormKind.LINE,
        fixed(_AMPLITUDE, *(Coefficient(n, CoefficientRole.SLOPE, unit="g") for n in ("slope", "square", "cube"))),
        ("signal",),
        {"knots": None},
        {"knots": "driver"},
        static=_cubic,
    ),
    Form(
        "direction",
        "a change that turns with the sign of the driver, as dry friction does, with a free constant",
        FormKind.TURN,
        _direction_coefficients,
        ("signal",),
        {"scale": None},
        {"scale": "driver"},
        static=_direction,
        abrupt=True,
    ),
    Form(
        "curve",
        "natural cubic spline of free shape",
        FormKind.CURVE,
        _curve_coefficients,
        ("signal", "time"),
        {"knots": None},
        {"knots": "driver"},
        static=_curve,
    ),
    Form(
        "polyline",
        "straight lines between knots, level beyond them",
        FormKind.CURVE,
        _curve_coefficients,
        ("signal", "time"),
        {"knots": None},
        {"knots": "driver"},
        static=_polyline,
    ),
    _limited("limited_line", "a straight line over the driver between two values of it, level beyond", _limited_line),
    _limited("limited_factor", "a factor that is such a line, instead of its logarithm", _limited_factor),
    Form(
        "hinge",
        "nothing below a threshold of the driver, a straight line above",
        FormKind.THRESHOLD,
        fixed(
            Coefficient("slope", CoefficientRole.GAIN, unit="g"),
            Coefficient("threshold", CoefficientRole.THRESHOLD, 0.0, unit="driver"),
        ),
        ("signal",),
        {"reference": None, "width": 0.02},
        {"reference": "driver"},
        static=_hinge,
    ),
    Form(
        "step",
        "a step at an onset",
        FormKind.EVENT,
        fixed(_AMPLITUDE, _ONSET),
        ("time",),
        {"width": 2.0},
        {"width": "s"},
        static=_step,
        abrupt=True,
    ),
    Form(
        "ramp",
        "a ramp from an onset, then constant",
        FormKind.EVENT,
        fixed(
            _AMPLITUDE,
            _ONSET,
            Coefficient("duration", CoefficientRole.DURATION, 600.0, SHORTEST, scale=100.0, unit="s"),
        ),
        ("time",),
        {},
        static=_ramp,
    ),
    Form(
        "washout",
        "an exponential approach from an onset, as a reagent that is washed out",
        FormKind.EVENT,
        fixed(
            _AMPLITUDE,
            _ONSET,
            Coefficient("time_constant", CoefficientRole.TIME_CONSTANT, 300.0, SHORTEST, scale=100.0, unit="s"),
        ),
        ("time",),
        {},
        static=_washout,
    ),
)
"""Constants, curves of a signal, and what happens at a time."""
