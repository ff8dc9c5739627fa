"""Events in time: a ramp, a washout or a step, started from what a free curve in time came to, and freer profiles.

The onset of an event has many local optima; a curve has none, as it is linear in its values. So the curve is fitted
first, and the events start from the shapes that draw it best. Last, the best profile gets more freedom: a curve more
knots (a slow random drift), a ramp or washout a curve whose knots stand where things happen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import EDGE, ONSETS, event
from adaptive_flot.discovery.candidates.knots import MOST_KNOTS, is_even
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.spline import drawn, knots_of, through
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray

REFINED = 33
"""Onsets that are tried around one of the catalogue."""
LENGTHS = (0.3, 0.55, 1.0, 1.8)
"""Factors of a duration or time constant that are tried with each."""
POINTS = 300
"""Times at which a curve is compared with an event."""
PLACES = 60
"""Onsets that are compared with a curve."""
DURATIONS = (0.03, 0.08, 0.15, 0.25, 0.4, 0.6)
"""Durations of ramps and washouts that are tried, as shares of the record."""
SLOW_S, SLOW_ROWS = 120.0, 50
"""A change over at least this long, and so many rows, is a drift; of an adapted parameter, that is what adaptation is
there to follow. Over fewer rows a record can not tell it from a step."""
LARGE = 0.4
"""Change of a logarithm (a factor of 1.5) beyond any drift that adaptation is known to follow: a quarter."""
SUDDEN = 0.1
"""Share of the record up to which a ramp or a washout may as well be a step."""
TAKES, SETTLES = 0.06, 3.0
"""Share of the record that an event around a step takes at first, and time constants after which it is over."""
AROUND = (-0.5, 0.0, 0.2, 0.45, 0.75, 1.1, 1.6, 2.5, 4.0)
"""Knots around an event, in lengths of it since its onset."""
KNOT_GAP = 0.01
"""Least distance of these from the ends of the record, as a share of it."""


def event_scores(score: Score, curve: Effect) -> list[Score]:
    """Scores with a ramp and a washout that start from a fitted curve in time of the same name.

    Parameters
    ----------
    score
        The candidate's score.
    curve
        The fitted curve, with its coefficients.
    """
    knots = knots_of(curve)
    t = np.linspace(knots[0], knots[-1], POINTS)
    values = drawn(curve, t)
    span = float(t[-1] - t[0])
    scores = []
    for form, role in (("ramp", CoefficientRole.DURATION), ("washout", CoefficientRole.TIME_CONSTANT)):
        amplitude, onset, length = _best(role, t, values, span)
        scores.append(_event(score, form, amplitude, (("onset", onset), (role.name.lower(), length)), curve, {}))
    return scores


def refined(scorer: Scorer, score: Score) -> Score:
    """The same event with its onset and length on a grid around the catalogue's: an onset has many local optima.

    Of one response x each, the score statistic is (x'M e)^2 / x'M x, and the amplitude x'M e / x'M x. A score that is
    no event comes back as it is, and so does a pulse: its edges are refined where it is sought.
    """
    effect, start = score.variant.effect, dict(score.variant.start)
    if not effect.family.is_event or effect.family.passes:
        return score
    (onset_name,) = effect.names(CoefficientRole.ONSET)
    lengths = effect.names(CoefficientRole.DURATION, CoefficientRole.TIME_CONSTANT)
    time = scorer.problem.record.time
    reach = (time[-1] - time[0]) / (ONSETS + 1)
    length = next((start[name] for name in lengths), 0.0)
    site, form = score.candidate.site, effect.form
    variants = [
        event(site, form, time, float(onset), length * factor, site.mode == "offset")
        for onset in start[onset_name] + reach * np.linspace(-1, 1, REFINED)
        for factor in (LENGTHS if length else (1.0,))
        if time[0] < onset < time[-1]
    ]
    columns = scorer.projected_profiles([v.profiles[0] for v in variants])
    gains = (columns.T @ scorer.residual) ** 2 / np.maximum(np.sum(columns**2, axis=0), 1e-300)
    best = int(np.argmax(gains))
    if gains[best] <= score.gain:
        return score
    amplitude = float(columns[:, best] @ scorer.residual / np.sum(columns[:, best] ** 2))
    penalised = score.penalised + float(gains[best]) - score.gain
    values = {"amplitude": amplitude, **dict(variants[best].start)}
    return replace(score, variant=variants[best], gain=float(gains[best]), penalised=penalised, start=values)


def step_score(score: Score, fitted: Effect, span: float) -> Score | None:
    """The score with a step, where a fitted ramp or washout of the same name is over at once; None elsewhere.

    `span` is the length of the record [s].
    """
    length = _length(fitted) if fitted.family.is_event and not fitted.family.passes else None
    if length is None or length > SUDDEN * span:
        return None
    (amplitude,), (onset,) = fitted.levels, fitted.values(CoefficientRole.ONSET)
    return _event(score, "step", amplitude, (("onset", onset + length / 2),), fitted, {"width": EDGE * span})


def slower_scores(score: Score, fitted: Effect, span: float) -> list[Score]:
    """Scores with a ramp and a washout that start around a fitted step of the same name; none for other forms.

    `span` is the length of the record [s].
    """
    if fitted.form != "step":
        return []
    (amplitude,), (onset,) = fitted.levels, fitted.values(CoefficientRole.ONSET)
    length = TAKES * span
    ramp = ("onset", onset - length / 2), ("duration", length)
    washout = ("onset", onset - length / SETTLES), ("time_constant", length / SETTLES)
    return [_event(score, form, amplitude, shape, fitted, {}) for form, shape in (("ramp", ramp), ("washout", washout))]


def other_shape(score: Score, fitted: Effect) -> Score | None:
    """The score with a washout where a fitted ramp of the same name is, and the reverse; None for other forms.

    Both begin at one onset, and the washout has settled when the ramp is over.
    """
    if fitted.form not in ("ramp", "washout"):
        return None
    (amplitude,), (onset,), length = fitted.levels, fitted.values(CoefficientRole.ONSET), _length(fitted)
    assert length is not None  # both forms have one
    if fitted.form == "ramp":
        return _event(score, "washout", amplitude, (("onset", onset), ("time_constant", length / SETTLES)), fitted, {})
    return _event(score, "ramp", amplitude, (("onset", onset), ("duration", length * SETTLES)), fitted, {})


def _event(
    score: Score,
    form: str,
    amplitude: float,
    shape: tuple[tuple[str, float], ...],
    like: Effect,
    settings: dict[str, float],
) -> Score:
    effect = Effect(like.site, "time", form, settings=settings, mode=like.mode)
    start = {"amplitude": amplitude, **dict(shape)}
    return replace(score, variant=Variant(effect, (), ("amplitude",), shape), start=start)


def freer(effect: Effect, low: float, high: float) -> tuple[Variant, dict[str, float]] | None:
    """A curve with more knots than a fitted curve, or around a fitted ramp or washout, and values to start from.

    The record lasts from `low` to `high` [s]. None for a step, which has no shape, for a pulse, for a curve that has
    the knots, and for a slow ramp, of which a curve with even knots is the freer form.
    """
    if effect.family.passes:
        return None
    if effect.family.is_curve:
        if len(knots_of(effect)) >= MOST_KNOTS:
            return None
        at = np.linspace(low, high, MOST_KNOTS)
        values = drawn(effect, at)
    else:
        length = _length(effect)
        if length is None or slow(effect):
            return None
        role = CoefficientRole.DURATION if effect.values(CoefficientRole.DURATION) else CoefficientRole.TIME_CONSTANT
        (amplitude,), (onset,) = effect.levels, effect.values(CoefficientRole.ONSET)
        lasts = length if role is CoefficientRole.DURATION else 2 * length
        around = onset + lasts * np.array(AROUND)
        inside = around[(around > low + KNOT_GAP * (high - low)) & (around < high - KNOT_GAP * (high - low))]
        at = np.concatenate([[low], inside, [high]])
        values = amplitude * _rise(role, at - onset, length)
    return through(effect, at, values)


def slow(effect: Effect, shortest: float = SLOW_S) -> bool:
    """Whether a time profile is a drift, and not an event: a ramp that lasts, or a curve with even knots.

    Such a curve is an event after all where it changes much, and half of that at once: in less than `shortest` [s].
    """
    if effect.family.is_curve:
        knots = knots_of(effect)
        return is_even(knots) and not _jumps(effect, knots, shortest)
    lasts = effect.values(CoefficientRole.DURATION)
    return not effect.family.passes and any(duration >= shortest for duration in lasts)


def _length(effect: Effect) -> float | None:
    """Duration or time constant [s] of a fitted event; None for a step, which takes no time."""
    return next(iter(effect.values(CoefficientRole.DURATION, CoefficientRole.TIME_CONSTANT)), None)


def _rise(role: CoefficientRole, since: FloatArray, length: float) -> FloatArray:
    """Part of an event (N,) that has happened at times since its onset (N,) [s]; `role` is that of its length [s]."""
    after = np.maximum(since, 0)
    if role is CoefficientRole.DURATION:
        straight: FloatArray = np.minimum(after / length, 1)
        return straight
    exponential: FloatArray = 1 - np.exp(-after / length)
    return exponential


def _jumps(effect: Effect, knots: list[float], shortest: float) -> bool:
    """Whether a curve changes by a large factor, half of all it ever changes in a short time."""
    t = np.linspace(knots[0], knots[-1], POINTS)
    values = drawn(effect, t)
    ahead = max(1, round(shortest / float(t[1] - t[0])))
    whole = float(np.ptp(values))
    return whole > LARGE and bool(np.max(np.abs(values[ahead:] - values[:-ahead]), initial=0.0) > whole / 2)


def _best(role: CoefficientRole, t: FloatArray, values: FloatArray, span: float) -> tuple[float, float, float]:
    """Amplitude, onset and duration whose event, up to a constant, is nearest to the values."""
    best = (np.inf, 0.0, float(t[len(t) // 2]), 0.1 * span)
    centred = values - values.mean()
    for onset in np.linspace(t[0], t[-1], PLACES + 2)[1:-1]:
        for share in DURATIONS:
            length = share * span
            if role is CoefficientRole.TIME_CONSTANT:
                length /= 3  # a washout of this time constant is done after about that duration
            profile = _rise(role, t - onset, length)
            profile = profile - profile.mean()
            amplitude = float(profile @ centred / max(profile @ profile, 1e-300))
            left = float(np.sum((centred - amplitude * profile) ** 2))
            if left < best[0]:
                best = (left, amplitude, float(onset), length)
    return best[1:]
