"""Whether a fitted fault can be what it says: not larger than such a fault is, and no stopped sensor that moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import Tested
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, noise_floor
from adaptive_flot.greybox.model import FloatArray, Model

AT_EDGE = 0.01
"""A coefficient is at the edge of its range when it is nearer to it than this share of the range."""
ERRORS = ("span", "offset", "lag")
"""Faults that have a size. A part may well be stuck at the end of its range."""
STILL = 1e-6
"""A prediction that moves by a smaller share of what was measured stands still."""
MOVES = 4.0
"""A measurement moves where nine tenths of its rows spread over so many standard deviations of its noise, 3.3 of which
noise alone has, and over so many of its smallest steps."""


def at_edge(tested: Tested) -> bool:
    """Whether a tested hypothesis rests at the end of what such a fault can be, see `rests_at_edge`."""
    return tested.hypothesis is not None and rests_at_edge(tested.hypothesis, tested.fit.value)


def rests_at_edge(h: Hypothesis, value: Callable[[str], float]) -> bool:
    """Whether a coefficient has come to rest at the end of what such a fault can be.

    The record then asks for more than the fault can give. The fault is no explanation, though it may fit best.

    Parameters
    ----------
    h
        The hypothesis.
    value
        Gives the fitted value of a parameter by its full name.
    """
    if h.kind not in ERRORS:
        return False
    for name, (low, high) in h.limits.items():
        at, near = value(h.effect.parameter(name)), AT_EDGE * (high - low)
        if (low < 0 and at < low + near) or (high > 0 and at > high - near):
            return True
    return False


def moves_though_stopped(model: Model, rows: Rows, tested: Tested) -> bool:
    """Whether a sensor of the model that is said to have stopped leaves an output without motion that was seen to move.

    A sensor that has stopped shows one value and nothing else, however near that value is to all of a record. Behind
    a valve that is stuck, an output may well move: by a disturbance that the model does not have.
    """
    h = tested.hypothesis
    if h is None or h.kind != "stuck" or next(s for s in model.sites if s.name == h.site).role != "sensor":
        return False
    for i, (record, errors) in enumerate(zip(rows.records, tested.fit.errors, strict=True)):
        there = rows.counted[i]
        for j, column in enumerate(rows.columns):
            measured = record.outputs[there, column]
            predicted = measured - errors[there, j]
            seen = np.isfinite(predicted)
            if seen.sum() > 2 and np.ptp(predicted[seen]) <= STILL * np.ptp(measured[seen]):
                if _moves(measured[seen], float(noise_floor([record], [column])[0])):
                    return True
    return False


def _moves(measured: FloatArray, noise: float) -> bool:
    low, high = np.quantile(measured, (0.05, 0.95))
    steps = np.abs(np.diff(np.unique(measured)))
    smallest = float(steps.min()) if steps.size else np.inf
    return bool(high - low > MOVES * max(noise, smallest))
