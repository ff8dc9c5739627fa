"""Curves in the search: their knots, what they draw, and the same curve through other knots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.static import spline_numbers
from adaptive_flot.greybox.model import FloatArray


def knots_of(effect: Effect) -> list[float]:
    """Knots of a curve."""
    return [float(k) for k in np.atleast_1d(np.asarray(effect.settings["knots"]))]


def values_of(effect: Effect) -> list[float]:
    """Values of a fitted curve at its knots; zero where it has no coefficient."""
    return [effect.coefficients.get(f"value_{k + 1}", 0.0) for k in range(len(knots_of(effect)))]


def spline_values(values: FloatArray, knots: Sequence[float]) -> FloatArray:
    """Cardinal natural splines (N, knots) at the values (N,): those of the model, to rounding."""
    return spline_numbers(values, np.asarray(knots, dtype=float))


def drawn(effect: Effect, values: FloatArray) -> FloatArray:
    """A fitted curve (N,) at the values (N,) of its driver."""
    if effect.form == "polyline":
        return np.asarray(np.interp(values, knots_of(effect), values_of(effect)))
    curve: FloatArray = spline_values(values, knots_of(effect)) @ values_of(effect)
    return curve


def through(like: Effect, knots: Sequence[float] | FloatArray, values: FloatArray) -> tuple[Variant, dict[str, float]]:
    """A curve at the site, driver and mode of another effect through other knots, and the values to start from."""
    settings = {"knots": tuple(float(k) for k in knots)}
    names = tuple(f"value_{k + 1}" for k in range(len(knots)))
    curve = Effect(like.site, like.driver, "curve", settings=settings, mode=like.mode)
    return Variant(curve, (), names), dict(zip(names, map(float, values), strict=True))
