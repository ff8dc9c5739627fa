"""A constant fault that is told, beside fixed constants of the model which do the same where they are off."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.further_sites.same_meaning import constants_alike
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import TELLING

DOES_THE_SAME = "without a reference this may be no fault"
"""How the note on such a constant begins."""


def with_constants_alike(state: State) -> State:
    """The state with a note on fixed constants that do what a constant effect does, which is told.

    A compressor that gives 6 % more than was asked was told with confidence. Its data sheet was 4 % off.
    """
    judged, model = state.judged, state.searched[1].base.model
    if judged.word not in TELLING or judged.best is None or state.contradiction:
        return state
    effects = [e for e in judged.best.effects if e.driver == "constant"]
    alike = dict.fromkeys(q for e in effects for q in constants_alike(model, e))
    if not alike:
        return state
    named = ", ".join(f"{q.label} ({q.value:g} {q.unit})" for q in alike)
    note = f"{DOES_THE_SAME}: a fixed constant that is as much off does what {effects[0].site} does: {named}"
    return replace(state, screening=replace(state.screening, notes=(*state.screening.notes, note)))
