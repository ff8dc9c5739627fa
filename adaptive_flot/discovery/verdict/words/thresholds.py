"""How far the thresholds of a switch may lie from where they were fitted: anywhere that switches on the same rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.shapes.relays import Thresholds
from adaptive_flot.discovery.record.problem import BoolArray
from adaptive_flot.discovery.results import NamedEffect
from adaptive_flot.discovery.verdict.words.curve import EffectCurve
from adaptive_flot.greybox.forms.form import CoefficientRole, number
from adaptive_flot.greybox.model import FloatArray

SETTLES = 3
"""Rows that a switch of the equations takes to move: on these the driver has passed a threshold, and nothing shows."""


def same_course(driver: FloatArray, is_on: BoolArray, settles: int = SETTLES) -> tuple[Thresholds, Thresholds]:
    """Ranges (least, largest) of the upper and the lower threshold of a switch that is on in some rows (N,).

    The upper one lies between the largest value of the driver (N,) that left the switch off, and the least that put it
    on. The lower one lies between the largest value that put it off, and the least that left it on. It shows on which
    side of the threshold the driver is after some rows (`settles`) at the latest.
    """
    moves = np.flatnonzero(is_on[1:] != is_on[:-1]) + 1
    stays, at = np.ones(len(driver), dtype=bool), [driver[max(k - settles, 0) : k + 1] for k in moves]
    for k in moves:
        stays[max(k - settles, 0) : k + 1] = False
    put_on = [float(np.max(v)) for k, v in zip(moves, at, strict=True) if is_on[k]]
    put_off = [float(np.min(v)) for k, v in zip(moves, at, strict=True) if not is_on[k]]
    upper = float(np.max(driver[~is_on & stays], initial=-np.inf)), min(put_on, default=np.inf)
    lower = max(put_off, default=-np.inf), float(np.min(driver[is_on & stays], initial=np.inf))
    return upper, lower


def with_ranges(told: Sequence[NamedEffect], curves: Sequence[EffectCurve], dt: float) -> tuple[NamedEffect, ...]:
    """The effects, with intervals of thresholds that hold all that the record can not tell from the fitted ones.

    An interval from the covariance of the fit is too narrow there: between two values of a driver that jumps, no row
    says anything, and the fit's rounding of the edge does. `dt` is the sampling interval [s].
    """
    by_label = {c.effect.label: c for c in curves}
    return tuple(_widened(e, by_label[e.effect.label], dt) if e.effect.label in by_label else e for e in told)


def _widened(told: NamedEffect, curve: EffectCurve, dt: float) -> NamedEffect:
    effect = told.effect
    if curve.is_on is None:
        return told
    wide = dict(told.interval95)
    # half way a switch is after log(2) time constants
    half_way = int(np.ceil(np.log(2) * number(effect.full_settings, "follow_s") / dt))
    ranges = same_course(curve.seen, curve.is_on, SETTLES + half_way)
    for name, ends in zip(effect.names(CoefficientRole.THRESHOLD), ranges, strict=True):
        if name in wide:
            every = [v for v in (*wide[name], *ends) if np.isfinite(v)]
            wide[name] = min(every), max(every)
    return replace(told, interval95=wide)
