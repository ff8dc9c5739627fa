"""An effect that is told, in the words of its user: what is the matter, by how much, in which direction and when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.wording import clock, last_digit, sticks
from adaptive_flot.discovery.results import Alternative, NamedEffect
from adaptive_flot.discovery.results.words import rough, short
from adaptive_flot.discovery.verdict.words.curve import EffectCurve
from adaptive_flot.greybox.effects import LATE, Effect
from adaptive_flot.greybox.forms.form import CoefficientRole, number
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.scope import Site

SHOWN = (0.02, 0.98)
"""Quantiles of a driver between which a dependence is told: beyond them it rests on a few rows."""
LARGE = 2.0
"""Factor above which a change is told as one, and not in per cent."""
SETTLED = 3.0
"""Time constants after which an exponential approach is over, but for a twentieth."""


def words_of_effects(model: Model, told: Sequence[NamedEffect], curves: Sequence[EffectCurve]) -> str:
    """One sentence, without its full stop, of all effects that are told."""
    by_label = {c.effect.label: c for c in curves}
    said = "; and ".join(words_of_effect(model, e, by_label.get(e.effect.label)) for e in told)
    return said[:1].upper() + said[1:]


def words_of_effect(model: Model, told: NamedEffect, curve: EffectCurve | None = None) -> str:
    """One effect: `froth recovery is 60 % smaller than the model says (95 %: 55 to 64 %; other froth than assumed)`.

    Parameters
    ----------
    model
        The model that has the effect.
    told
        The effect with its intervals.
    curve
        What it does over its driver; None where it has none (a constant, a lag, a dead time, a limit).
    """
    effect = told.effect
    site = next(s for s in model.sites if s.name == effect.site)
    name = spaced(site.name)
    if effect.driver == "constant":
        said = f"{name} {_always(site, effect)}"
    elif effect.driver == "lag" and effect.values(CoefficientRole.BAND):
        (band,), rest = effect.values(CoefficientRole.BAND), sum(effect.values(CoefficientRole.REST))
        said = f"{name} {sticks(band, rest, _unit(site), jumps=effect.family.jumps)}"
    elif effect.driver == "lag":
        taus = " and ".join(f"{short(v)} s" for v in effect.values(CoefficientRole.TIME_CONSTANT))
        said = f"{name} answers slowly, with a time constant of {taus}"
    elif effect.driver == "delay" and (read := effect.values(CoefficientRole.READING)):
        interval = (read[1] - read[0]) / number(effect.full_settings, "periods")
        said = f"{name} is read every {short(interval)} s, and kept in between"
    elif effect.driver == "delay":
        (dead,) = effect.values(CoefficientRole.DEAD_TIME)
        said = f"{name} answers {short(dead)} s late"
    elif effect.driver == "saturation":
        (limit,) = effect.values(CoefficientRole.LIMIT)
        said = f"{name} does not go beyond {short(limit)}{_unit(site)}"
    elif floor := effect.values(CoefficientRole.FLOOR):
        said = f"{name} does not go below {short(floor[0])}{_unit(site)}, whatever is asked"
    elif effect.family.is_event and (level := effect.values(CoefficientRole.POSITION)):
        (begin,), (long,) = effect.values(CoefficientRole.ONSET), effect.values(CoefficientRole.DURATION)
        verb, asked = ("showed", "") if site.role == "sensor" else ("stayed at", ", whatever was asked")
        said = f"{name} {verb} {short(level[0])}{_unit(site)} from {clock(begin)} s to {clock(begin + long)} s{asked}"
    elif curve is not None and effect.family.is_event and _may_end(told) > curve.driver[-1]:
        # what has happened until then is told, without the interval of all that would
        return f"{name} {_until_the_end(site, curve)}" + (f" ({told.meaning})" if told.meaning else "")
    elif effect.family.is_event:
        said = f"{name} {_event(site, effect)}"
    elif effect.family.memory:
        said = f"{name} {_switched(model, site, effect)}"
    elif curve is None and effect.driver == "time":
        low, high = (_deviation(site, effect, v) for v in (min(effect.levels), max(effect.levels)))
        said = f"{name} {'wanders' if effect.form == 'polyline' else 'changes'} in time, between {low} and {high}"
    elif effect.family.turns:
        said = f"{name} depends on the sign of {spaced(effect.driver)}: {_over_sign(site, effect)}"
    elif curve is None:
        said = f"{name} depends on {spaced(effect.driver)}"
    elif effect.driver == "time":
        said = f"{name} {_in_time(site, curve)}"
    else:
        said = f"{name} depends on {spaced(effect.driver)}: {_over_driver(site, curve)}"
    notes = [n for n in (_interval(site, told), told.meaning) if n]
    return f"{said} ({'; '.join(notes)})" if notes else said


def words_alone(a: Alternative) -> str:
    """The only effect of an alternative as it was fitted in the search, without an interval and without a curve."""
    (words,) = words_each(a).values()
    return words


def words_each(a: Alternative) -> dict[tuple[str, str], str]:
    """Each effect of an alternative as it was fitted in the search, by its name (site, driver)."""
    return {(e.site, e.driver): words_of_effect(a.fit.model, NamedEffect(e, "", {}, ())) for e in a.effects}


def spaced(name: str) -> str:
    """A name as it is read: `froth recovery`."""
    return name.replace("_", " ")


def _always(site: Site, effect: Effect) -> str:
    (level,) = effect.levels
    if site.role == "sensor":
        return f"shows {_amount(site, effect, level)} too {'much' if level > 0 else 'little'}"
    where = {"actuator": "was asked", "feed": "the record says"}.get(site.role, "the model says")
    if _is_factor(site, effect):
        return f"is {_times(float(np.exp(level)))} {where}"
    return f"is {_amount(site, effect, level)} {'more' if level > 0 else 'less'} than {where}"


def _may_end(told: NamedEffect) -> float:
    """Time [s] at which an event may be over, an exponential approach but for a twentieth, or its last onset.

    By the upper ends of the 95 % intervals: of a fall that lasts, a record may know how fast it is, and not how long.
    """
    effect = told.effect
    onsets, roles = effect.values(CoefficientRole.ONSET), (CoefficientRole.DURATION, CoefficientRole.TIME_CONSTANT)
    lasting, settles = (
        [told.interval95.get(n, (0.0, effect.coefficients[n]))[1] for n in effect.names(role)] for role in roles
    )
    if not effect.family.passes:
        return max(onsets) + max(lasting, default=0.0) + SETTLED * max(settles, default=0.0)
    return max(onsets) + max(effect.values(CoefficientRole.DURATION), default=0.0)


def _event(site: Site, effect: Effect) -> str:
    (level,), (onset,) = effect.levels, effect.values(CoefficientRole.ONSET)
    durations = effect.values(CoefficientRole.DURATION)
    if effect.family.passes:
        verb, stood = ("showed", "more") if site.role == "sensor" else ("was", "larger")
        if level < 0:
            stood = "less" if site.role == "sensor" else "smaller"
        end = onset + durations[0]
        when = f"from {clock(onset)} s to {clock(end)} s"
        return f"{verb} {_amount(site, effect, level)} {stood} {when} than before and after"
    lasts = [*durations, *(SETTLED * t for t in effect.values(CoefficientRole.TIME_CONSTANT))]
    gradual = lasts and lasts[0] > last_digit(onset)
    when = f"from {clock(onset)} s to {clock(onset + lasts[0])} s" if gradual else f"at {clock(onset)} s"
    factor = float(np.exp(level)) if _is_factor(site, effect) else None
    return f"{_moved(site, _amount(site, effect, level), rises=level > 0, factor=factor)} {when}"


def _switched(model: Model, site: Site, effect: Effect) -> str:
    """A switch with two thresholds: `is 20 % smaller once level has risen above 0.4 m, until it falls below 0.3 m`."""
    *others, level = effect.levels
    on_above, off_below = (effect.coefficients[n] for n in effect.names(CoefficientRole.THRESHOLD))
    units = {q.name: q.unit for q in (*model.inputs, *model.states, *model.signals)}
    unit = units.get(effect.driver, "-")
    unit = "" if unit == "-" else f" {unit}"
    what, *before = (_off(site, effect, each) for each in (level, *others))
    begun = f"once {spaced(effect.driver)} has risen above {short(on_above)}{unit}"
    otherwise = f", and {before[0]} otherwise" if before else ""
    return f"{what} {begun}, until it falls below {short(off_below)}{unit}{otherwise}"


def _off(site: Site, effect: Effect, level: float) -> str:
    """How far a part is off: `shows 2 K more`, `is 20 % smaller`."""
    if site.role == "sensor":
        return f"shows {_amount(site, effect, level)} {'more' if level > 0 else 'less'}"
    return f"is {_amount(site, effect, level)} {'larger' if level > 0 else 'smaller'}"


def _until_the_end(site: Site, curve: EffectCurve) -> str:
    """An event that is not over when the record ends: how far it has come by then."""
    rises, factor = bool(curve.change[-1] > curve.change[0]), _ratio(curve, 0, -1) if curve.relative else None
    onset = max(curve.effect.values(CoefficientRole.ONSET))
    moved = _moved(site, _between(site, curve, 0, -1), rises=rises, factor=factor)
    return f"{moved} from {clock(onset)} s to the end of the record"


def _in_time(site: Site, curve: EffectCurve) -> str:
    """The largest change between two times; of what wanders, how far it goes down and up."""
    if curve.effect.form == "polyline":
        ends = float(np.min(curve.change)), float(np.max(curve.change))
        low, high = (_deviation(site, curve.effect, float(np.log(v)) if curve.relative else v) for v in ends)
        return f"wanders in time, between {low} and {high}"
    a, b = _extremes(curve)
    factor = _ratio(curve, a, b) if curve.relative else None
    moved = _moved(site, _between(site, curve, a, b), rises=bool(curve.change[b] > curve.change[a]), factor=factor)
    return f"{moved} from {clock(curve.driver[a])} s to {clock(curve.driver[b])} s"


def _moved(site: Site, size: str, *, rises: bool, factor: float | None) -> str:
    """What has happened: `fell by 20 %`, `rose to 2.8 times what it was`; `factor` is None of an offset."""
    if factor is not None and factor > LARGE and site.role != "sensor":
        return f"rose to {rough(factor)} times what it was"
    if site.role == "sensor":
        return f"came to show {size} {'more' if rises else 'less'}"
    return f"{'rose' if rises else 'fell'} by {size}"


def _over_sign(site: Site, effect: Effect) -> str:
    """The difference that the sign of the driver makes: `40.8 N more above zero than below`."""
    (half,) = effect.values(CoefficientRole.SLOPE)
    return f"{_deviation(site, effect, 2 * half)} above zero than below"


def _over_driver(site: Site, curve: EffectCurve) -> str:
    a, b = _extremes(curve)
    driver, unit = spaced(curve.effect.driver), f" {curve.driver_unit}" if curve.driver_unit not in ("", "-") else ""
    here, there = f"at {driver} {short(curve.driver[b])}{unit}", f"at {short(curve.driver[a])}{unit}"
    if curve.relative:
        size, word = _times(_ratio(curve, a, b)).rsplit(" ", 1)
        return f"{size} {here} {word} {there}"
    if curve.bend_only:  # the straight part is one of the adapted parameters
        most = int(np.argmax(np.abs(curve.change)))
        more = "more" if curve.change[most] > 0 else "less"
        size = f"{short(abs(curve.change[most]))}{_unit(site)} {more}"
        return f"{size} at {driver} {short(curve.driver[most])}{unit} than a straight line through the middle says"
    more = "more" if curve.change[b] > curve.change[a] else "less"
    return f"{_between(site, curve, a, b)} {more} {here} than {there}"


def _extremes(curve: EffectCurve) -> tuple[int, int]:
    """Places of the smallest and the largest change over what most rows have seen, in the order of the driver."""
    low, high = np.quantile(curve.seen, SHOWN)
    inside = np.flatnonzero((curve.driver >= low) & (curve.driver <= high))
    inside = inside if inside.size else np.arange(len(curve.driver))
    places = inside[np.argmin(curve.change[inside])], inside[np.argmax(curve.change[inside])]
    return int(min(places)), int(max(places))


def _between(site: Site, curve: EffectCurve, a: int, b: int) -> str:
    """Size of the change between two places of a curve."""
    if curve.relative:
        return _percent(_ratio(curve, a, b))
    return f"{short(abs(curve.change[b] - curve.change[a]))}{_unit(site)}"


def _ratio(curve: EffectCurve, a: int, b: int) -> float:
    return float(curve.change[b] / max(float(curve.change[a]), 1e-12))


def _deviation(site: Site, effect: Effect, level: float) -> str:
    """A change at a site: `20 % less`, `0.3 K more`."""
    if _is_factor(site, effect):
        return _times(float(np.exp(level))).rsplit(" ", 1)[0]
    return f"{short(abs(level))}{_unit(site)} {'more' if level > 0 else 'less'}"


def _amount(site: Site, effect: Effect, level: float) -> str:
    if not _is_factor(site, effect):
        return f"{short(abs(level))}{_unit(site)}"
    return _percent(float(np.exp(level)))


def _is_factor(site: Site, effect: Effect) -> bool:
    return (effect.mode or site.mode) != "offset"


def _times(factor: float) -> str:
    """A factor with the word that compares: `20 % less than`, `2.8 times as much as`."""
    if factor > LARGE:
        return f"{rough(factor)} times as much as"
    return f"{_percent(factor)} {'more' if factor > 1 else 'less'} than"


def _percent(factor: float) -> str:
    return f"{abs(100 * (factor - 1)):.2g} %" if abs(factor - 1) < 0.1 else f"{abs(100 * (factor - 1)):.0f} %"


def _interval(site: Site, told: NamedEffect) -> str:
    """The 95 % interval of a single size, a time constant or a dead time; empty for a curve."""
    effect = told.effect
    has_one = effect.driver in ("constant", "lag", "delay") or effect.family.is_event or effect.family.memory
    if not has_one:
        return ""
    level = effect.driver not in LATE
    roles = (CoefficientRole.LEVEL,) if level else (CoefficientRole.TIME_CONSTANT, CoefficientRole.DEAD_TIME)
    known = [told.interval95[n] for n in effect.names(*roles) if n in told.interval95]
    if len(known) != 1 and (not known or effect.family.memory):  # of two levels, each has its own
        return ""
    low, high = sorted(known[0], key=abs)
    if not level:
        return f"95 %: {_apart(low, high)} s"
    if low * high < 0:
        signed = (f"{'-' if v < 0 else '+'}{_amount(site, effect, v)}" for v in known[0])
        return f"95 %: {' to '.join(signed)}"
    if _is_factor(site, effect) and np.exp(high) > LARGE:
        return f"95 %: {_apart(np.exp(low), np.exp(high), 2)} times"
    if _is_factor(site, effect):
        return f"95 %: {_percents(abs(100 * np.expm1(low)), abs(100 * np.expm1(high)))} %"
    return f"95 %: {_apart(abs(low), abs(high))}{_unit(site)}"


def _apart(low: float, high: float, digits: int = 3) -> str:
    """Two ends of an interval, with as many digits, up to 6, as tell them apart."""
    for n in range(digits, 6):
        if f"{low:.{n}g}" != f"{high:.{n}g}":
            return f"{low:.{n}g} to {high:.{n}g}"
    return f"{low:.6g} to {high:.6g}"


def _percents(low: float, high: float) -> str:
    """Two ends of an interval in percent with the digits of a size, rounded outwards: so they hold what is told."""

    def step(percent: float) -> float:
        return 1.0 if percent >= 10 else 10.0 ** (np.floor(np.log10(max(percent, 1e-9))) - 1)

    ends = np.floor(low / step(low) + 1e-9) * step(low), np.ceil(high / step(high) - 1e-9) * step(high)
    return " to ".join(f"{end:.0f}" if end >= 10 else f"{end:.2g}" for end in ends)


def _unit(site: Site) -> str:
    return f" {site.unit}" if site.unit and site.unit != "-" else ""
