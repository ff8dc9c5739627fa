"""Events that seem to begin where a sensor says nothing: their time is doubtful, and this is said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.assessment.telling_rows import edges
from adaptive_flot.discovery.candidates.spline import knots_of
from adaptive_flot.discovery.record.screening import Suspect
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole

ROWS_BESIDE = 5
"""Rows beside such a part that count as in it."""


def event_times(effect: Effect) -> tuple[tuple[float, float], ...]:
    """When an effect of time changes most, first and last time [s] of each; none for other effects.

    An onset is an instant, and so is the end of a pulse. A gradual change takes its duration. A curve changes most
    between the two knots whose values differ most.
    """
    if effect.driver != "time":
        return ()
    if effect.family.passes:
        return tuple((t, t) for t in edges(effect))
    lasting = sum(effect.coefficients.get(n, 0.0) for n in effect.names(CoefficientRole.DURATION))
    onsets = tuple(
        (effect.coefficients[n], effect.coefficients[n] + lasting)
        for n in effect.names(CoefficientRole.ONSET)
        if n in effect.coefficients
    )
    if onsets or not effect.family.is_curve:
        return onsets
    knots, moves = knots_of(effect), np.abs(np.diff(effect.levels))
    k = int(np.argmax(moves))
    return ((float(knots[k]), float(knots[k + 1])),)


def suspect_notes(effects: Sequence[Effect], suspects: Sequence[Suspect], dt: float) -> tuple[str, ...]:
    """A word on each effect that seems to begin within, or just beside, a part of the record that is suspect."""
    said = []
    for effect in effects:
        for start, end in event_times(effect):
            there = next(
                (s for s in suspects if s.start - ROWS_BESIDE * dt <= end and start <= s.end + ROWS_BESIDE * dt), None
            )
            if there is not None:
                when = f"{start:g} s" if start == end else f"{start:g} to {end:g} s"
                said.append(f"suspect: {effect.site} changes at {when}, where {there}")
    return tuple(said)
