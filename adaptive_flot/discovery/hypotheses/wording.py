"""A hypothesis in words: size, direction, unit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.record.slip_jump import PLAY
from adaptive_flot.discovery.results.words import in_seconds, rough, short
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.quantities import ARBITRARY_ZERO

MOST_TIMES = 6
"""Times that a sentence lists at most."""
NOTHING = "next to nothing"
LEAST_SPAN = 5e-3
"""An error of a span that is told as a percentage above zero."""
PROPORTIONAL = 0.05
"""A sensor's error in the middle of its range is its share of the value, where it is so close to that."""
WITHOUT_SIZE = {
    "time": "changes with time",
    "constant": "is off all the time",
    "own_value": "is off by more at some of its values than at others",
    "saturation": "has a limit",
    "lag": "answers late",
    "delay": "answers late",
}
"""What is said of an alternative of the free run, by what it depends on."""


def sticks(band: float, rest: float, unit: str, *, jumps: bool) -> str:
    """What a part does that follows only beyond a band: it jumps to what is asked, to within a rest, or has play."""
    if not jumps or rest > PLAY * band:
        return f"has play: it stays up to {short(rest if jumps else band)}{unit} behind what is asked"
    then = f"jumps to within {short(rest)}{unit} of what is asked" if rest else "jumps to what is asked"
    return f"sticks: it stays until it is asked to move by more than {short(band)}{unit}, and then {then}"


def clock(time: float) -> str:
    """A time [s]: whole seconds, and three digits below a hundred."""
    return f"{time:.0f}" if abs(time) >= 100 else short(time)


def last_digit(time: float) -> float:
    """What one step of the last digit is in which `clock` tells a time [s].

    >>> last_digit(1036888.0), last_digit(47.8)
    (1.0, 0.1)
    """
    size = abs(time)
    return 1.0 if size >= 100 or not size else float(f"{10 ** (np.floor(np.log10(size)) - 2):.0e}")


def words_of(model: Model, h: Hypothesis, value: Callable[[str], float]) -> str:
    """One sentence without its full stop: what is the matter and by how much.

    `value` gives the fitted value of a parameter by its full name.
    """
    if h.kind == "alternative":  # most are curves, whose size is no single number
        driver = f"depends on {h.driver.replace('_', ' ')}"
        return f"{h.site.replace('_', ' ')} {WITHOUT_SIZE.get(h.driver, driver)}"
    values = dict(zip(h.free, (value(name) for name in h.parameters), strict=True))
    site = next(s for s in model.sites if s.name == h.site)
    name, unit = site.name.replace("_", " "), f" {site.unit}" if site.unit and site.unit != "-" else ""
    first, mode = _at_its_end(next(iter(values.values())), h), h.effect.mode or site.mode
    if h.kind == "stuck" and site.role == "sensor":
        return f"{name} shows {short(first)}{unit} all the time"
    if h.kind == "stuck":
        return f"{name} stays at {short(first)}{unit}, whatever is asked"
    if h.kind == "stuck for a time":
        ((begin, long),) = h.pulses
        when = f"from {clock(begin)} s on" if long >= FOREVER else f"at {clock(begin)}-{clock(begin + long)} s"
        if site.role == "sensor":
            return f"{name} shows {short(first)}{unit} and nothing else {when}"
        return f"{name} stays at {short(first)}{unit} {when}, whatever is asked"
    if h.kind == "leaks":
        return f"{name} does not go below {short(first)}{unit}"
    if h.kind == "range":
        return f"{name} does not go above {short(first)}{unit}"
    if h.kind == "switch":
        return f"{name} {_switched(h.effect, mode, first, unit, site.role == 'sensor')}"
    if h.kind == "ramp":
        return f"{name} {_grows(h.effect, mode, first, unit, site.role == 'sensor')}"
    if h.kind == "periodic":
        return f"{name} {_swings(float(np.hypot(values['sine'], values['cosine'])), values['period'], mode, unit)}"
    if h.kind == "cycle":
        return f"{name} {_cycles(h.effect, mode, first, unit, site.role == 'sensor')}"
    if h.kind == "hysteresis":
        return f"{name} {sticks(first, values.get('rest', 0.0), unit, jumps=h.effect.family.jumps)}"
    if h.kind == "dead zone":
        centre = h.effect.coefficients["centre"]
        return f"{name} does not move within {short(first)}{unit} of {short(centre)}{unit}"
    if h.kind == "gain":
        return f"{name} is {_factor(first)}"
    if h.kind == "offset":
        verb = "shows" if site.role == "sensor" else "is"
        return f"{name} {verb} {short(abs(first))}{unit} too {'much' if first > 0 else 'little'}"
    if h.kind == "span":
        middle = h.effect.settings["middle"]
        if site.unit not in ARBITRARY_ZERO and _is_proportional(values["offset"], values["slope"], middle):
            much = "much" if values["slope"] > 0 else "little"
            return f"{name} shows {rough(abs(100 * values['slope']))} % too {much}"
        span = max(1 + values["slope"], 1e-9)
        rest = f"and a span {_factor(float(np.log(span)))}" if abs(span - 1) >= LEAST_SPAN else "and its span is right"
        return f"{name} is wrongly calibrated: {values['offset']:+.3g}{unit} in the middle of its range, {rest}"
    if h.kind == "sign":
        return f"{name} does not see the sign: it shows the absolute value ({100 * first:.0f} % of the way)"
    if h.kind == "lag":
        what = "dead time" if h.driver == "delay" else "time constant"
        return f"{name} answers late, with a {what} of {short(first)} s"
    if h.kind == "store":
        tau = values["time_constant"]
        return (
            f"{name} lacks a second store behind {h.driver.replace('_', ' ')}, with a time constant of {short(tau)} s"
        )
    if h.kind == "turns":
        more = f"{short(abs(2 * values['turn']))}{unit} {'more' if values['turn'] > 0 else 'less'}"
        return f"{name} depends on the sign of {h.driver.replace('_', ' ')}: {more} above zero than below"
    change = values["value_2"] - values["value_1"]
    low, high = h.effect.settings["knots"]  # type: ignore[misc]
    driver = h.driver.replace("_", " ")
    if h.effect.mode == "offset":
        more = f"{short(abs(change))}{unit} {'more' if change > 0 else 'less'}"
        return f"{name} depends on {driver}: {more} at {driver} {short(high)} than at {short(low)}"
    return f"{name} depends on {driver}: {_compared(change, f'{driver} {short(high)}', short(low))}"


def _is_proportional(offset: float, slope: float, middle: object) -> bool:
    """Whether an error of a span, and that in the middle of the range, are one share of the value."""
    there = slope * float(middle)  # type: ignore[arg-type]
    return there != 0.0 and abs(offset - there) <= PROPORTIONAL * abs(there)


def _at_its_end(value: float, h: Hypothesis) -> float:
    """The value, or the end of its range where it lies within a thousandth of that."""
    if len(h.free) != 1 or not h.limits:
        return value
    low, high = h.limits[h.free[0]]
    return next((end for end in (low, high) if abs(value - end) < 1e-3 * (high - low)), value)


def _factor(log: float) -> str:
    factor = float(np.exp(log))
    if factor < 0.02:
        return NOTHING
    if 0.5 < factor < 2.0:
        return f"{abs(100 * (factor - 1)):.0f} % {'larger' if factor > 1 else 'smaller'}"
    return f"{rough(factor)} times as large"


def _compared(log: float, here: str, there: str) -> str:
    """How a value compares at two places: `2 times as large at flow 4 as at 1`, `20 % larger at flow 4 than at 1`."""
    factor = _factor(log)
    if factor.endswith("times as large"):
        return f"{factor} at {here} as at {there}"
    return f"{factor} at {here}, unlike at {there}" if factor == NOTHING else f"{factor} at {here} than at {there}"


def _swings(size: float, period: float, mode: str, unit: str) -> str:
    """How far it goes up and down, and how often: `swings by 0.4 K up and down every 900 s`."""
    swing = f"{short(size)}{unit}" if mode == "offset" else f"{rough(100 * size)} %"
    return f"swings by {swing} up and down every {in_seconds(period)} s"


def cycle_times(effect: Effect) -> str:
    """When something is on that is switched in every period: `for 8 h of every 24 h, first at 0-28800 s`."""
    onset, duration, period = (effect.coefficients[name] for name in ("onset", "duration", "period"))
    first = f"first at {clock(onset)}-{clock(onset + duration)} s"
    return f"for {_hours(duration)} of every {_hours(period)}, {first}"


def _hours(duration: float) -> str:
    """A duration [s]: `8 h`, and below two hours `900 s`."""
    return f"{duration / 3600:.3g} h" if duration >= 7200 else f"{in_seconds(duration)} s"


def _cycles(effect: Effect, mode: str, size: float, unit: str, sensor: bool) -> str:
    """What is switched in every period: `is 47 % larger for 8 h of every 24 h, first at 0-28800 s`."""
    return f"{_while_on(mode, size, unit, sensor)} {cycle_times(effect)}"


def _while_on(mode: str, size: float, unit: str, sensor: bool) -> str:
    """What is switched, while it is on: `is 47 % larger`, `shows 0.3 K less`."""
    if mode == "offset":
        return f"{'shows' if sensor else 'is'} {short(abs(size))}{unit} {'more' if size > 0 else 'less'}"
    return f"is {_factor(size)}"


def _grows(effect: Effect, mode: str, size: float, unit: str, sensor: bool) -> str:
    """What changes gradually, with its times: `becomes 27 % smaller, gradually from 1380 to 1900 s`."""
    onset, duration = effect.coefficients["onset"], effect.coefficients["duration"]
    if mode == "offset":
        change = f"comes to {'show' if sensor else 'be'} {short(abs(size))}{unit} {'more' if size > 0 else 'less'}"
    else:
        change = f"becomes {_factor(size)}"
    return f"{change}, gradually from {clock(onset)} to {clock(onset + duration)} s"


def _switched(effect: Effect, mode: str, size: float, unit: str, sensor: bool) -> str:
    """What is switched, with its times: `fell by 20 % at 1500 s`, `is 4.1 times as large at 2053-2213 s, ...`."""
    count = int(effect.settings["count"])  # type: ignore[arg-type]
    on = [effect.coefficients[f"on_{k}"] for k in range(1, count + 1)]
    duration = [effect.coefficients[f"for_{k}"] for k in range(1, count + 1)]
    lasting = count == 1 and duration[0] >= FOREVER
    rest = _while_on(mode, size, unit, sensor)
    if lasting:
        return f"{rest} from {clock(on[0])} s on"
    if count == 1:  # it may as well have wandered there
        return f"{rest} from {clock(on[0])} to {clock(on[0] + duration[0])} s"
    times = [
        f"{clock(a)}-{clock(a + d)} s" if d < FOREVER else f"from {clock(a)} s on"
        for a, d in zip(on, duration, strict=True)
    ]
    listed = ", ".join(times[:MOST_TIMES]) + (f" and {len(times) - MOST_TIMES} more" if len(times) > MOST_TIMES else "")
    return f"{rest} while something is switched: {listed}"
