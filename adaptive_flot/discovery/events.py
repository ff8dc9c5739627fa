"""Events in time: a step, a ramp or a washout, started from what a free curve in time came to.

The onset of an event has many local optima; a curve has none, as it is linear in its values. So the curve is fitted
first, and the events start from the shapes that draw it best.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.catalogue import Variant, spline_values
from adaptive_flot.discovery.scoring import Score
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

POINTS = 300
"""Times at which a curve is compared with an event."""
ONSETS = 60
DURATIONS = (0.03, 0.08, 0.15, 0.25, 0.4, 0.6)
"""Durations of ramps and washouts that are tried, as shares of the record."""


def event_scores(score: Score, curve: Effect) -> list[Score]:
    """Scores with a step, a ramp and a washout that start from a fitted curve in time of the same name.

    Parameters
    ----------
    score
        The candidate's score.
    curve
        The fitted curve, with its coefficients.
    """
    knots = [float(k) for k in np.atleast_1d(np.asarray(curve.settings["knots"]))]
    t = np.linspace(knots[0], knots[-1], POINTS)
    values = spline_values(t, knots) @ [curve.coefficients[f"value_{k + 1}"] for k in range(len(knots))]
    span = float(t[-1] - t[0])
    found = []
    for form, second in (("step", None), ("ramp", "duration"), ("washout", "time_constant")):
        amplitude, onset, length = _best(form, t, values, span)
        settings = {"width": max(2.0, span / 1000)} if form == "step" else {}
        effect = Effect(curve.site, "time", form, settings=settings, mode=curve.mode)
        shape = (("onset", onset), *(((second, length),) if second else ()))
        start = {"amplitude": amplitude, **dict(shape)}
        found.append(replace(score, variant=Variant(effect, (), ("amplitude",), shape), start=start))
    return found


def _best(form: str, t: FloatArray, values: FloatArray, span: float) -> tuple[float, float, float]:
    """Amplitude, onset and duration whose event, up to a constant, is nearest to the values."""
    best = (np.inf, 0.0, float(t[len(t) // 2]), 0.1 * span)
    centred = values - values.mean()
    for onset in np.linspace(t[0], t[-1], ONSETS + 2)[1:-1]:
        for share in DURATIONS if form != "step" else (0.0,):
            length = share * span
            if form == "step":
                course = (t >= onset).astype(float)
            elif form == "ramp":
                course = np.clip((t - onset) / length, 0, 1)
            else:
                length /= 3  # a washout of this time constant is done after about that duration
                course = 1 - np.exp(-np.maximum(t - onset, 0) / length)
            course = course - course.mean()
            amplitude = float(course @ centred / max(course @ course, 1e-300))
            left = float(np.sum((centred - amplitude * course) ** 2))
            if left < best[0]:
                best = (left, amplitude, float(onset), length)
    return best[1:]
