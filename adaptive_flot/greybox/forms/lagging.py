"""Forms with states of their own: the value is delayed (lags, dead time, even readings, a valve that sticks)."""

from __future__ import annotations

from math import log

import casadi as ca

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


READS_WITHIN, READS, LEAKS = 0.6, 3.0, 1e-6
"""A reading takes about so many intervals (standard deviation of its bump), at a rate of so much an interval: 99 % of
the way. Shorter ones would fall between the steps. Between them it leaks a little, so that a record begins with what
was read."""


def _held(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """A state x that follows the value v while it is read, at the distance d in time from the nearest reading.

    With the sampling interval h::

        dx/dt = r (v - x),   r = READS / h exp(-(d / (READS_WITHIN h))^2 / 2),   d = P / pi sin(pi (t - first) / P)
    """
    scale, interval = number(s, "scale"), number(s, "interval_s")
    period = (c["last_reading"] - c["first_reading"]) / number(s, "periods")
    x = m.own_state("held")
    distance = period / ca.pi * ca.sin(ca.pi * (driver - c["first_reading"]) / period)
    rate = (LEAKS + READS * ca.exp(-0.5 * (distance / (READS_WITHIN * interval)) ** 2)) / interval
    m.own_derivative("held", rate * (value / scale - x), decay=-rate)
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
    moved = softplus(error - band, width) - softplus(-error - band, width)
    m.own_derivative("position", moved / follow)
    return value + c["amplitude"] * (x * scale - value)


JUMP_EDGE = 0.002
"""Rounding of the band of a part that jumps, as a share of it: at 0.99 of the band it creeps by 1 % a row."""
JUMPS_BY = 1000.0
"""Rate of a jump, times the sampling interval: a step that is a fiftieth of it leaves nothing of the jump (2e-9)."""

LARGEST_REST = 0.97
"""Largest rest, as a share of the band: with a larger one it stays in the rounding of the band and creeps."""
CREEPS = 1e-9
"""Share of the way that it creeps in an interval, so that a record begins with what was asked."""


def _slip_jump(m: SiteScope, value: ca.SX, driver: ca.SX, c: Coefs, s: Settings) -> ca.SX:
    """A part at x that stays where it is until v is more than the band away, and then jumps to v, less a rest.

    The model of stiction with two parameters: He, Wang, Pottmann & Qin, *A curve fitting method for detecting valve
    stiction in oscillating control loops*, Ind. Eng. Chem. Res. 46 (2007), with f_s the band and f_d the rest. Without
    a rest it is that of Stenman, Gustafsson & Forsman, Int. J. Adapt. Control Signal Process. 17 (2003). Here, with the
    interval h::

        dx/dt = r (w - x) + CREEPS / h (v - x),   w = v - rest sign(v - x),   r = JUMPS_BY m / h,
        m = 1 / (1 + JUMPS_BY exp((band - |v - x|) / (JUMP_EDGE band)))

    so that r = 1 / h at the band. What acts is x + m (w - x): the jump at its beginning. The rate is handed to the step
    as that of a fast state. The step holds it at its value at the start, so that x is at w when it ends, although the
    slope is nothing on the way.
    """
    del driver
    scale, interval = number(s, "scale"), number(s, "interval_s")
    x = m.own_state("position")
    error, band = value / scale - x, c["band"] / scale
    beyond = (ca.fabs(error) - band) / (JUMP_EDGE * (band + 1e-9)) - log(JUMPS_BY)
    moves = (1 + ca.tanh(beyond / 2)) / 2
    rest = ca.fmin(c["rest"] / scale, LARGEST_REST * band)
    rate, way = JUMPS_BY / interval * moves, error - rest * error / (ca.fabs(error) + 1e-12)
    m.own_derivative("position", rate * way + CREEPS / interval * error, decay=-rate)
    return value + c["amplitude"] * ((x + moves * way) * scale - value)


def _delay_states(settings: Settings) -> tuple[str, ...]:
    return tuple(f"stage_{k + 1}" for k in range(int(number(settings, "stages"))))


LAGGING_FORMS: tuple[Form, ...] = (
    Form(
        "lag",
        "first-order lag",
        FormKind.MEMORY,
        fixed(BLEND, Coefficient("time_constant", CoefficientRole.TIME_CONSTANT, 30.0, SHORTEST, scale=10.0, unit="s")),
        ("lag",),
        {"scale": None},
        {"scale": "value"},
        direct=_lag,
        states=lambda settings: ("lagged",),
        abrupt=True,
    ),
    Form(
        "lags",
        "two first-order lags in a row",
        FormKind.MEMORY,
        fixed(
            BLEND,
            Coefficient("time_constant", CoefficientRole.TIME_CONSTANT, 20.0, SHORTEST, scale=10.0, unit="s"),
            Coefficient("time_constant_2", CoefficientRole.TIME_CONSTANT, 10.0, SHORTEST, scale=10.0, unit="s"),
        ),
        ("lag",),
        {"scale": None},
        {"scale": "value"},
        direct=_lags,
        states=lambda settings: ("lagged_1", "lagged_2"),
        abrupt=True,
    ),
    Form(
        "delay",
        "dead time, as a chain of equal lags",
        FormKind.MEMORY,
        fixed(BLEND, Coefficient("dead_time", CoefficientRole.DEAD_TIME, 30.0, SHORTEST, scale=10.0, unit="s")),
        ("delay",),
        {"scale": None, "stages": 12.0},
        {"scale": "value"},
        direct=_delay,
        states=_delay_states,
        abrupt=True,
    ),
    Form(
        "held",
        "read at even intervals, and kept in between",
        FormKind.MEMORY,
        fixed(
            BLEND,
            Coefficient("first_reading", CoefficientRole.READING, 0.0, scale=10.0, unit="s"),
            Coefficient("last_reading", CoefficientRole.READING, 1000.0, scale=10.0, unit="s"),
        ),
        ("delay",),
        {"scale": None, "periods": 10.0, "interval_s": 1.0},
        {"scale": "value", "interval_s": "s"},
        direct=_held,
        states=lambda settings: ("held",),
        abrupt=True,
    ),
    Form(
        "stiction",
        "the value follows only when the demand leaves a band",
        FormKind.MEMORY,
        fixed(BLEND, Coefficient("band", CoefficientRole.BAND, 0.0, 0.0, unit="value")),
        ("lag",),
        {"scale": None, "follow_s": 2.0},
        {"scale": "value", "follow_s": "s"},
        direct=_stiction,
        states=lambda settings: ("position",),
        abrupt=True,
    ),
    Form(
        "slip_jump",
        "the value stays until the demand leaves a band, and then jumps to it, less a rest",
        FormKind.MEMORY,
        fixed(
            BLEND,
            Coefficient("band", CoefficientRole.BAND, 0.0, 0.0, unit="value"),
            Coefficient("rest", CoefficientRole.REST, 0.0, 0.0, unit="value"),
        ),
        ("lag",),
        {"scale": None, "interval_s": 1.0},
        {"scale": "value", "interval_s": "s"},
        direct=_slip_jump,
        states=lambda settings: ("position",),
        abrupt=True,
        jumps=True,
    ),
)
"""Each is switched on by its blend; its times and its band are shapes."""
