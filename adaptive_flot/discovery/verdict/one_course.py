"""Several changes with one course in time are one cause that acts at several places: no name of a part is told.

A cell that cools changes the size of the bubbles, the flow of the concentrate and more, all at once and in proportion.
A search that knows causes at one place each finds two or three of them. Each fits, and none is what has happened.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import casadi as ca
import numpy as np

from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import TELLING
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

SAME_COURSE = 0.97
"""Correlation of two changes over the record, up to the sign, from which they have one course."""
POINTS = 200
"""Even times at which they are compared."""


def heed_one_course(state: State) -> State:
    """Tell no name where two changes at different sites have one course, and say that they have.

    ::

        |corr(g_1(t_k), g_2(t_k))| > SAME_COURSE

    over even times t_k, with the fitted changes g of the two. Two causes that have nothing to do with one another turn
    at different times.
    """
    judged = state.judged
    if judged.best is None or judged.word not in TELLING or judged.part:
        return state
    time = state.searched[0].record.time
    changes = [(e, _change(e, time)) for e in judged.best.effects if e.driver == "time" and e.family.static]
    for (a, x), (b, y) in combinations(changes, 2):
        together = float(np.corrcoef(x, y)[0, 1]) if np.ptp(x) > 0 and np.ptp(y) > 0 else 0.0
        if a.site != b.site and abs(together) > SAME_COURSE:
            why = (
                f"{spaced(a.site)} and {spaced(b.site)} change with one course in time (correlation {together:.2f}). "
                "One cause that acts at several places looks like that, and the catalogue has none"
            )
            return replace(state, judgement=replace(judged, word="abstain", members=()), contradiction=why)
    return state


def _change(effect: Effect, time: FloatArray) -> FloatArray:
    """What a fitted effect does at some times (POINTS,) of a record."""
    t = ca.SX.sym("t")
    coefficients: dict[str, ca.SX] = {name: ca.SX(value) for name, value in effect.coefficients.items()}
    assert effect.family.static is not None  # all others have been left out
    law = ca.Function("change", [t], [ca.SX(effect.family.static(t, coefficients, effect.full_settings))])
    at = np.linspace(time[0], time[-1], POINTS)
    change: FloatArray = np.array(law(at[None, :]), dtype=float).ravel()
    return change
